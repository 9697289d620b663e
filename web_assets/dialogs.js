/* Dialogs and the keys of the shell; extends window.oasis of shell.js, once per page. */
(function () {
  "use strict";
  const oasis = window.oasis;
  if (oasis.askReason) return;

  /* ---- dialogs ---- */

  // Keys of viser's commands, told by the server; a new connection tells them anew.
  let keys = [], keysOf = null;
  const known = () => {
    if (keysOf !== oasis.options()) { keysOf = oasis.options(); keys = keysOf.keys.slice(); }
    return keys;
  };
  const shut = (shown) => { shown.close(); shown.remove(); };
  const dialog = (id, title) => {
    const old = document.getElementById(id);
    if (old) old.remove();
    const made = oasis.element(id, "dialog");
    made.className = "oa";
    made.setAttribute("aria-label", title);
    made.appendChild(document.createElement("h2")).textContent = title;
    made.addEventListener("keydown", (event) => {
      // Otherwise keys typed here would fire viser's commands behind the dialog.
      event.stopPropagation();
      // Not left to the browser: until its next frame the focus would stay in the closed dialog and
      // swallow the next key.
      if (event.key === "Escape") { event.preventDefault(); shut(made); }
    });
    made.addEventListener("close", () => made.remove());
    return made;
  };
  const button = (holder, text, action, primary) => {
    const made = holder.appendChild(document.createElement("button"));
    made.type = "button";
    made.textContent = text;
    if (primary) made.className = "oa-primary";
    made.onclick = action;
    return made;
  };
  const help = () => {
    const shown = document.getElementById("oa-help");
    if (shown) { shut(shown); return; }
    const made = dialog("oa-help", "Keys");
    const table = made.appendChild(document.createElement("table"));
    for (const [key, meaning] of known()) {
      const row = table.insertRow();
      row.insertCell().appendChild(document.createElement("kbd")).textContent = key;
      row.insertCell().textContent = meaning;
    }
    button(made.appendChild(document.createElement("footer")), "Close", () => shut(made), true);
    made.showModal();
  };
  const form = (id, title, hint) => {
    const made = dialog(id, title);
    if (hint) made.appendChild(document.createElement("p")).textContent = hint;
    const field = made.appendChild(document.createElement("textarea"));
    field.maxLength = oasis.options().maxText;
    field.setAttribute("aria-label", title);
    const footer = made.appendChild(document.createElement("footer"));
    button(footer, "Cancel", () => shut(made));
    return { made, field, footer };
  };
  const show = ({ made, field, footer }, kind) => {
    const save = button(footer, "Save (Ctrl+Enter)", () => {
      if (!field.value.trim()) return;
      oasis.send(kind, field.value);
      shut(made);
    }, true);
    const follow = () => { save.disabled = !field.value.trim(); };
    field.addEventListener("input", follow);
    follow();
    made.addEventListener("keydown", (event) => {
      if (event.key === "Enter" && (event.ctrlKey || event.metaKey)) { event.preventDefault(); save.click(); }
    });
    made.showModal();
    field.focus();
  };
  const askNote = () => show(form("oa-ask", "Note"), "note");
  const askText = (title, hint, text, kind) => {
    const asked = form("oa-ask", title, hint);
    asked.field.value = text;
    show(asked, kind);
  };
  const askReason = (title, hint) => {
    const asked = form("oa-ask", title, hint);
    asked.field.placeholder = "What shows it?";
    // An empty field could be an oversight; this button says that it is none.
    button(asked.footer, "No reason", () => { oasis.send("no_reason"); shut(asked.made); })
      .title = "Save the label; the journal will say that no reason was given";
    show(asked, "reason");
  };
  const open = (what) => { if (what === "help") help(); else if (what === "note") askNote(); };

  /* ---- keys ---- */

  const isTyping = (node) => node instanceof Element &&
    (node.matches("textarea, select, input:not([type=range]):not([type=checkbox])") || node.isContentEditable);
  window.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.repeat) return;
    if (document.querySelector("dialog[open]")) {
      if (event.key === "?" && document.getElementById("oa-help")) help();
      return;
    }
    const target = event.target;
    if (isTyping(target)) return;
    const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    if (key === "Enter" || key === " ") {
      const focused = target instanceof Element ? target.closest("[data-send], [data-open]") : null;
      if (target instanceof Element && target.matches("button, a, summary, input, [role=tab]")) return;
      const pressed = focused || (key === "Enter" ? document.querySelector("[data-accept]:not(:disabled)") : null);
      if (!pressed) return;
      pressed.click();
    } else if (key === "x") oasis.send("swipe");
    else if (key === "h") oasis.send("overview");
    else if (key === "m") open("note");
    else if (key === "?") open("help");
    else if (key === "l") oasis.copyLink();
    else if (key === "Escape") {
      document.querySelectorAll(".oa details[open]").forEach((details) => { details.open = false; });
      oasis.element("oa-toast", "div").classList.remove("oa-shown");
      oasis.send("escape");
      return;
    } else return;
    event.preventDefault();
  }, true);

  Object.assign(oasis, {
    askReason, askText, help, open, form, shut, button,
    addKey: (key, meaning) => { known().push([key, meaning]); },
  });
})
