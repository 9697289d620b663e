/* Lines between the pictures of the band, from [data-link-from] to [data-link-to] of the same number.
   Once per page; drawn anew whenever the band changes or its pictures move. */
(function () {
  "use strict";
  const oasis = window.oasis;
  if (oasis.drawLinks) return;
  const NS = "http://www.w3.org/2000/svg";

  const draw = () => {
    const band = document.getElementById("oa-band");
    const pictures = band && band.querySelector(".oa-pictures");
    if (!pictures) return;
    let overlay = pictures.querySelector(":scope > .oa-lines");
    const starts = [...pictures.querySelectorAll("[data-link-from]")];
    if (!starts.length) { if (overlay) overlay.remove(); return; }
    if (!overlay) {
      overlay = document.createElementNS(NS, "svg");
      overlay.setAttribute("class", "oa-lines");
      pictures.appendChild(overlay);
    }
    const frame = pictures.getBoundingClientRect();
    const middle = (node) => {
      const box = node.getBoundingClientRect();
      return [box.left + box.width / 2 - frame.left, box.top + box.height / 2 - frame.top];
    };
    overlay.replaceChildren(...starts.flatMap((start) => {
      const end = pictures.querySelector(`[data-link-to="${start.getAttribute("data-link-from")}"]`);
      if (!end) return [];
      const [x1, y1] = middle(start), [x2, y2] = middle(end);
      return ["oa-under", ""].map((kind) => {
        const line = document.createElementNS(NS, "line");
        for (const [name, value] of Object.entries({ x1, y1, x2, y2 })) line.setAttribute(name, value.toFixed(1));
        line.setAttribute("class", `${start.getAttribute("class").replace("oa-end", "oa-between")} ${kind}`);
        line.style.setProperty("--s", start.style.getPropertyValue("--s"));
        return line;
      });
    }));
  };
  let asked = false;
  const soon = () => {
    if (asked) return;
    asked = true;
    requestAnimationFrame(() => { asked = false; draw(); });
  };
  const ours = (record) => record.target instanceof Element && record.target.closest(".oa-lines") ||
    [...record.addedNodes, ...record.removedNodes].every((n) => n instanceof Element && n.matches(".oa-lines"));
  new MutationObserver((records) => { if (!records.every(ours)) soon(); })
    .observe(oasis.element("oa-band", "div"), { childList: true, subtree: true });
  new ResizeObserver(soon).observe(oasis.element("oa-band", "div"));
  oasis.drawLinks = soon;
})
