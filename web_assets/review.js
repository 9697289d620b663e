/* Search, skip, picking another object, and the dialog before a correction; extends window.oasis, once per
   page. */
(function () {
  "use strict";
  const oasis = window.oasis;
  if (oasis.confirm) return;

  /* ---- confirm ---- */

  const confirm = (title, text, buttons) => {
    const { made, field, footer } = oasis.form("oa-ask", title, text);
    field.placeholder = "Why? (kept with your name and the time)";
    let main = null;
    buttons.forEach(([choice, words], place) => {
      const last = place === buttons.length - 1;
      const pressed = oasis.button(footer, last ? words + " (Ctrl+Enter)" : words, () => {
        oasis.send("confirmed", { choice, reason: field.value });
        oasis.shut(made);
      }, last);
      if (last) main = pressed;
    });
    made.addEventListener("keydown", (event) => {
      if (event.key === "Enter" && (event.ctrlKey || event.metaKey)) { event.preventDefault(); main.click(); }
    });
    made.showModal();
    field.focus();
  };

  /* ---- picking another object ---- */

  let picking = false;
  const setPicking = (text) => {
    picking = text !== "";
    const box = oasis.element("oa-picking", "div");
    box.className = "oa";
    box.setAttribute("role", "status");
    box.hidden = !picking;
    box.textContent = text;
    if (!picking) return;
    const end = box.appendChild(document.createElement("button"));
    end.textContent = "Cancel (Esc)";
    end.onclick = () => oasis.send("end_pick");
  };

  /* ---- keys ---- */

  const isTyping = (node) => node instanceof Element &&
    (node.matches("textarea, select, input:not([type=range]):not([type=checkbox])") || node.isContentEditable);
  let finding = null;  // what was typed while the tab with the field was on its way
  const find = () => {
    const tabs = [...document.querySelectorAll("[role=tab]")];
    const queue = tabs.find((tab) => tab.textContent.trim() === "Queue");
    if (queue && queue.getAttribute("aria-selected") !== "true") {
      // Viser's tabs listen to the keyboard and to drags, not to clicks.
      queue.dispatchEvent(new KeyboardEvent("keydown", { key: "Enter", bubbles: true }));
    }
    finding = "";
    let tries = 0;
    const focus = () => {
      const field = document.querySelector("[data-search]");
      if ((!field || !field.offsetParent) && ++tries < 60) { requestAnimationFrame(focus); return; }
      const early = finding;
      finding = null;
      if (!field || !field.offsetParent) return;
      field.focus();
      field.select();
      if (!early) return;
      field.value = early;
      field.dispatchEvent(new Event("input", { bubbles: true }));
    };
    focus();
  };
  const typed = (event, field) => {
    // Otherwise letters and figures would fire viser's commands behind the field.
    event.stopPropagation();
    if (event.key === "Enter" && field.hasAttribute("data-enter")) {
      oasis.send(field.getAttribute("data-enter"), field.value);
      field.blur();
    } else if (event.key === "Escape") field.blur();
  };
  window.addEventListener("keydown", (event) => {
    if (document.querySelector("dialog[open]")) return;
    if (finding !== null) {
      event.stopImmediatePropagation();
      event.preventDefault();
      if (event.key.length === 1) finding += event.key;
      return;
    }
    const target = event.target;
    if (target instanceof Element && target.matches("[data-search], .oa-filters input, .oa-filters select")) {
      typed(event, target);
      return;
    }
    if (event.ctrlKey || event.metaKey || event.altKey || event.repeat || isTyping(target)) return;
    if (event.key === "/") find();
    else if (event.key === ".") oasis.send("skip");
    else if (event.key === "Escape" && picking) oasis.send("end_pick");
    else return;
    event.preventDefault();
  }, true);
  // What was chosen lets go of the focus as well: it would swallow the keys of all commands.
  document.addEventListener("change", (event) => {
    const field = event.target;
    if (field instanceof Element && field.matches(".oa-filters select, .oa-filters input[type=checkbox]")) field.blur();
  });
  // What was clicked with the pointer lets go of the focus, so that Enter accepts and does not click it again.
  document.addEventListener("click", (event) => {
    const clicked = event.target instanceof Element && event.target.closest(".oa [data-send], .oa [data-object]");
    if (event.detail > 0 && clicked && !oasis.isField(clicked) && clicked.contains(document.activeElement)) {
      document.activeElement.blur();
    }
  });
  // A menu closes once something was chosen in it, or something else is clicked.
  document.addEventListener("click", (event) => {
    document.querySelectorAll("details.oa-correct[open]").forEach((menu) => {
      const inside = event.target instanceof Element && menu.contains(event.target);
      if (!inside || event.target.closest("button")) menu.open = false;
    });
  });

  /* ---- where others are ---- */

  const cursorStyle = oasis.element("oa-cursors", "style", document.head);
  const setCursors = (others) => {
    const initials = new Map();
    for (const [name, objectId] of others) {
      const first = [...name].find((letter) => /[\p{L}\p{N}]/u.test(letter)) || "?";
      initials.set(objectId, (initials.get(objectId) || "") + first.toUpperCase());
    }
    // Rules, not elements: the list is drawn anew without them.
    cursorStyle.textContent = [...initials].map(([objectId, letters]) =>
      `.oa-row[data-object="${Number(objectId)}"]::after{content:"${letters}"}`).join("\n");
  };

  Object.assign(oasis, { confirm, setPicking, setCursors });
})
