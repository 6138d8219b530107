/* The tables of results: a click on a heading sorts, and the address keeps it. */
"use strict";

const Results = (() => {
  let sorted = "";

  function start() {
    document.querySelectorAll("table.sortable").forEach((table) => {
      for (const button of table.querySelectorAll("thead button")) {
        button.addEventListener("click", () => {
          // The best place is the least; of values the best is the most.
          const first = button.dataset.first || "descending";
          const isFirst = button.closest("th").getAttribute("aria-sort") !== first;
          const isDown = (first === "descending") === isFirst;
          sort(table, Number(button.dataset.column), isDown);
          Address.note();
        });
      }
    });
  }

  /** Rows without a value come last, either way. */
  function sort(table, column, isDown) {
    table.querySelectorAll("th[aria-sort]").forEach((head) => head.removeAttribute("aria-sort"));
    table.tHead.rows[0].cells[column].setAttribute("aria-sort", isDown ? "descending" : "ascending");
    const body = table.tBodies[0];
    const value = (row) => (row.cells[column].dataset.value ? Number(row.cells[column].dataset.value) : null);
    const rows = [...body.rows].sort((a, b) => {
      const [x, y] = [value(a), value(b)];
      if (x === null || y === null) return Number(x === null) - Number(y === null);
      return isDown ? y - x : x - y;
    });
    body.append(...rows);
    sorted = `${table.dataset.track}.${column}.${isDown ? "down" : "up"}`;
  }

  /** Take the words of an address. */
  function restore(words) {
    const [track, column, way] = (words.get("sort") || "").split(".");
    const table = document.querySelector(`table.sortable[data-track="${CSS.escape(track)}"]`);
    if (table?.tHead.rows[0].cells[Number(column)]?.querySelector("button")) sort(table, Number(column), way !== "up");
  }

  return { start, restore, asked: () => ({ sort: sorted }) };
})();
