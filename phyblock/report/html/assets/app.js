/* The page: views, theme, keyboard, address. */
"use strict";

(() => {
  const THEME = "phyblock-theme";
  const root = document.documentElement;
  const detail = document.getElementById("detail");
  const other = document.getElementById("compare");
  const title = document.getElementById("sample-title");
  let opened = null;

  function theme(name) {
    root.dataset.theme = name;
    document.getElementById("theme").setAttribute("aria-pressed", String(name === "dark"));
    Detail.drawPictures(detail);
    Detail.player?.tell();
  }

  const isDark = () => root.dataset.theme === "dark"
    || (!root.dataset.theme && matchMedia("(prefers-color-scheme: dark)").matches);

  /** Browsers may forbid storage to pages from disk; the theme is then not remembered. */
  function stored(name) {
    try {
      if (name !== undefined) localStorage.setItem(THEME, name);
      return localStorage.getItem(THEME);
    } catch (error) {
      if (error instanceof DOMException) return null;
      throw error;
    }
  }

  function startTheme() {
    document.getElementById("theme").addEventListener("click", () => {
      const name = isDark() ? "light" : "dark";
      stored(name);
      theme(name);
    });
    const kept = stored();
    if (kept === "light" || kept === "dark") theme(kept);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
      Detail.drawPictures(detail);
      Detail.player?.tell();
    });
  }

  function view(name) {
    for (const section of document.querySelectorAll("[data-view]")) section.hidden = section.dataset.view !== name;
    for (const link of document.querySelectorAll("nav a")) {
      if (link.hash === `#${name}`) link.setAttribute("aria-current", "page");
      else link.removeAttribute("aria-current");
    }
    root.dataset.shown = name;
    if (name === "samples") return openSamples();
    return Promise.resolve();
  }

  /** The index is read when the samples are first looked at. */
  function openSamples() {
    opened = opened || Data.open().then(() => {
      List.start(choose);
      other.addEventListener("change", () => choose(List.chosen));
    }).catch((error) => {
      detail.replaceChildren(el("p", { class: "notice" }, error.message));
      throw error;
    });
    return opened;
  }

  /** Models that have a sample of the same item and seed, asked the same way, as [row, name]. */
  function rivals(sample) {
    const { rows } = Data.index;
    const found = [];
    for (const by of [-1, 1]) {
      for (let row = sample.row + by; rows.item[row] === sample.item; row += by) {
        const alike = rows.seed[row] === sample.seed && rows.variant[row] === rows.variant[sample.row];
        if (alike) found.push([row, Data.index.models[rows.model[row]]]);
      }
    }
    return found.sort((a, b) => rows.model[a[0]] - rows.model[b[0]]);
  }

  function choose(row) {
    if (row < 0) return;
    const sample = Data.sample(row);
    const wanted = other.value;
    const open = rivals(sample);
    other.replaceChildren(el("option", { value: "" }, "Nothing"),
      ...open.map(([, name]) => el("option", { value: name, selected: name === wanted }, name)));
    other.disabled = !open.length;
    const beside = open.find(([, name]) => name === wanted);
    title.replaceChildren(el("span", { class: "title-key" }, sample.key),
      el("span", { class: "muted" }, sample.asked));
    const address = new URLSearchParams({ s: sample.id, ...(beside ? { with: wanted } : {}) });
    history.replaceState(null, "", `#samples?${address}`);
    document.getElementById("workspace").dataset.detail = "shown";
    detail.scrollTop = 0;
    Detail.show(detail, row, beside ? beside[0] : -1, List.setting);
  }

  /** Show what the address names: #results, #samples, or a sample. */
  async function go() {
    const [name, query] = location.hash.slice(1).split("?");
    await view(name === "samples" ? "samples" : "results");
    if (name !== "samples") return;
    const asked = new URLSearchParams(query || "");
    const row = asked.has("s") ? Data.find(asked.get("s")) : -1;
    if (asked.get("with")) {
      other.replaceChildren(el("option", { value: asked.get("with"), selected: true }, asked.get("with")));
    }
    if (row >= 0) List.show(row);
    else if (List.chosen < 0 && matchMedia("(min-width: 60rem)").matches) List.move(0);
  }

  const keys = {
    j: () => List.move(1),
    k: () => List.move(-1),
    ArrowDown: () => List.move(1),
    ArrowUp: () => List.move(-1),
    PageDown: () => List.move(10),
    PageUp: () => List.move(-10),
    " ": () => Detail.player?.toggle(),
    ArrowRight: () => scrub(1),
    ArrowLeft: () => scrub(-1),
    "/": () => document.getElementById("search").focus(),
    c: () => other.focus(),
  };

  function scrub(by) {
    Detail.player?.stop();
    Detail.player?.seek(Detail.player.at + by);
  }

  function onKey(event) {
    if (root.dataset.shown !== "samples" || !Data.index) return;
    if (event.ctrlKey || event.metaKey || event.altKey || event.defaultPrevented) return;
    const on = event.target;
    if (on.id === "search" && event.key === "Escape") on.blur();
    if (on.matches("input, select, textarea")) return;
    // Space and arrows keep what they mean on a button or a folded part.
    if (event.key === " " && on.matches("button, summary, a")) return;
    if (!Object.hasOwn(keys, event.key)) return;
    event.preventDefault();
    keys[event.key]();
  }

  function sortable(table) {
    const body = table.tBodies[0];
    for (const button of table.querySelectorAll("th button")) {
      button.addEventListener("click", () => {
        const cell = button.closest("th");
        const down = cell.getAttribute("aria-sort") !== "descending";
        table.querySelectorAll("th[aria-sort]").forEach((head) => head.removeAttribute("aria-sort"));
        cell.setAttribute("aria-sort", down ? "descending" : "ascending");
        const column = Number(button.dataset.column);
        const value = (row) => {
          const said = row.cells[column].dataset.value;
          return said === undefined || said === "" ? -Infinity : Number(said);
        };
        const rows = [...body.rows].sort((a, b) => (down ? value(b) - value(a) : value(a) - value(b)));
        body.append(...rows);
      });
    }
  }

  startTheme();
  document.querySelectorAll("table.sortable").forEach(sortable);
  document.getElementById("previous").addEventListener("click", () => List.move(-1));
  document.getElementById("next").addEventListener("click", () => List.move(1));
  document.getElementById("back").addEventListener("click", () => {
    document.getElementById("workspace").dataset.detail = "hidden";
  });
  document.addEventListener("keydown", onKey);
  addEventListener("hashchange", go);
  let waiting = 0;
  addEventListener("resize", () => {
    cancelAnimationFrame(waiting);
    waiting = requestAnimationFrame(() => {
      Detail.drawPictures(detail);
      Detail.player?.tell();
    });
  });
  go();
})();
