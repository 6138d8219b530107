/* The page: what the address names is shown; keyboard, Back and Forward, paper. */
"use strict";

const App = (() => {
  const WAIT_MS = 250;
  const VIEWS = { results: Results.view, model: Views.model, scenes: Views.scenes, scene: Views.scene, samples: List.view };
  const root = document.documentElement;
  const place = document.getElementById("content");
  const warning = document.getElementById("warning");
  let turn = 0;
  let shown = "";
  let waiting = 0;

  // ---- the address

  /** An address of a view; words without a value are left out. */
  function address(view, words = {}) {
    const given = Object.entries(words).filter(([, word]) => word !== "" && word !== null && word !== undefined);
    const query = new URLSearchParams(given).toString();
    return `#${view}${query ? `?${query}` : ""}`;
  }

  function read() {
    const [view, query] = location.hash.slice(1).split(/\?(.*)/s);
    return { view: view || "results", words: new URLSearchParams(query || "") };
  }

  /** Show a view: as a place of its own that Back leads to, or over the present one. */
  function go(view, words, isNew = true) {
    clearTimeout(waiting);
    const next = address(view, words);
    if (next !== location.hash) history[isNew ? "pushState" : "replaceState"](null, "", next);
    return show();
  }

  /** Write words over those of the present place once nothing has changed for a while. */
  function note(changes) {
    clearTimeout(waiting);
    const before = location.hash;
    waiting = setTimeout(() => {
      const { view, words } = read();
      // Back may have gone to another place: it is not written over.
      if (location.hash === before) history.replaceState(null, "", address(view, { ...Object.fromEntries(words), ...changes }));
    }, WAIT_MS);
  }

  // ---- what is shown

  async function show() {
    const mine = ++turn, { view, words } = read();
    clearTimeout(waiting);
    let made;
    try {
      made = await (Object.hasOwn(VIEWS, view) ? VIEWS[view](words) : Views.unknown("page", view));
    } catch (error) {
      made = [el("h1", {}, "This cannot be shown"), el("p", { class: "notice" }, error.message)];
    }
    // A later choice may have been quicker.
    if (mine !== turn) return;
    const { parts = made, unknown = [] } = made;
    const focused = document.activeElement?.id, isSame = shown === view;
    if (parts.some((part) => part && !place.contains(part))) place.replaceChildren(...parts.filter(Boolean));
    shown = root.dataset.shown = view;
    place.className = view === "samples" ? "" : "site";
    warning.hidden = !unknown.length;
    warning.textContent = `The link names something that is not here: ${unknown.join("; ")}.`;
    for (const link of document.querySelectorAll(".top nav a")) {
      if (link.hash === `#${view}`) link.setAttribute("aria-current", "page");
      else link.removeAttribute("aria-current");
    }
    document.title = [...new Set([[...place.querySelectorAll("h1")].find((one) => one.checkVisibility())?.textContent, Data.board.title])].filter(Boolean).join(" · ");
    if (isSame) document.getElementById(focused)?.focus({ preventScroll: true });
    else if (mine > 1) {
      window.scrollTo(0, 0);
      place.focus({ preventScroll: true });
    }
    Sample.player?.tell();
  }

  function redraw(isPrinted = false) {
    Stage.redraw(place, isPrinted);
    Sample.player?.tell();
  }

  // ---- keys, paper

  const step = (by) => Sample.player?.stopAt(Sample.player.at + by);
  const KEYS = {
    j: (event) => List.move(1, event.repeat), k: (event) => List.move(-1, event.repeat),
    " ": () => Sample.player?.toggle(), ArrowRight: () => step(1), ArrowLeft: () => step(-1),
    "/": () => document.getElementById("search").focus(), c: () => document.getElementById("compare")?.focus(),
  };

  function onKey(event) {
    if (shown !== "samples" || event.ctrlKey || event.metaKey || event.altKey || event.defaultPrevented) return;
    if (event.target.matches("input, select, textarea") || !Object.hasOwn(KEYS, event.key)) return;
    // Space keeps its meaning on a button or a folded part.
    if (event.key === " " && event.target.matches("button, summary, a")) return;
    event.preventDefault();
    KEYS[event.key](event);
  }

  /** On paper everything is open; what was closed is closed again afterwards. */
  function startPrint() {
    let opened = [];
    addEventListener("beforeprint", () => {
      opened = [...document.querySelectorAll("details:not([open])")];
      opened.forEach((one) => one.setAttribute("open", ""));
      redraw(true);
    });
    addEventListener("afterprint", () => opened.forEach((one) => one.removeAttribute("open")));
  }

  function start() {
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => redraw());
    startPrint();
    document.addEventListener("keydown", onKey);
    document.querySelector(".skip").addEventListener("click", (event) => {
      event.preventDefault();
      (place.querySelector(".detail") || place).focus();
    });
    addEventListener("hashchange", show);
    let resized = 0;
    addEventListener("resize", () => {
      cancelAnimationFrame(resized);
      resized = requestAnimationFrame(() => redraw());
    });
    show();
  }

  return { address, go, note, start };
})();

App.start();
