/* Tables of cells: arrow keys walk through them, and what a cell says is written below. Once per page. */
(function () {
  "use strict";
  if (window.oasis.hasGrids) return;
  window.oasis.hasGrids = true;
  const STEPS = { ArrowLeft: [0, -1], ArrowRight: [0, 1], ArrowUp: [-1, 0], ArrowDown: [1, 0] };

  const cellAt = (table, row, column) => table.rows[row]?.cells[column]?.querySelector("button") || null;
  window.addEventListener("keydown", (event) => {
    const step = STEPS[event.key];
    const button = event.target instanceof Element ? event.target.closest("[data-grid] button") : null;
    if (!step || !button || event.ctrlKey || event.metaKey || event.altKey) return;
    // The arrows belong to the camera everywhere else.
    event.stopPropagation();
    event.preventDefault();
    const cell = button.closest("td, th");
    const next = cellAt(button.closest("table"), cell.parentElement.rowIndex + step[0], cell.cellIndex + step[1]);
    if (!next) return;
    // One stop for Tab in the whole table: the cell where one was last.
    if (button.hasAttribute("tabindex") && next.hasAttribute("tabindex")) {
      button.tabIndex = -1;
      next.tabIndex = 0;
    }
    next.focus();
  }, true);

  const say = (event) => {
    const cell = event.target instanceof Element ? event.target.closest("[data-words]") : null;
    const line = cell && cell.closest(".oa").querySelector(".oa-cell-words");
    if (line) line.textContent = cell.getAttribute("data-words");
  };
  document.addEventListener("pointerover", say);
  document.addEventListener("focusin", say);
})
