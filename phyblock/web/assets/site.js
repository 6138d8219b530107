/* The site: what the address names is shown; theme, keyboard, Back and Forward. */
"use strict";

var Site = (() => {
  const THEME = "phyblock-theme";
  const root = document.documentElement;
  let turn = 0;

  /** Browsers may forbid storage to pages from disk; nothing is then remembered. */
  function kept(name, value) {
    try {
      if (value !== undefined) localStorage.setItem(name, value);
      return localStorage.getItem(name);
    } catch (error) {
      if (error instanceof DOMException) return null;
      throw error;
    }
  }

  /** An address of a view; words without a value are left out. */
  function address(view, words = {}) {
    const given = Object.entries(words).filter(([, word]) => word !== "" && word !== null && word !== undefined);
    const query = new URLSearchParams(given).toString();
    return `#${view}${query ? `?${query}` : ""}`;
  }

  /** The words by which a replay is found again, on another build too. */
  const wordsOf = (sample) => ({ m: sample.entry.name, t: sample.track.name, i: sample.key, n: String(sample.seed), w: sample.way });

  function go(view, words) {
    const next = address(view, words);
    if (next === location.hash) return show();
    location.hash = next;
    return null;
  }

  const VIEWS = { board: (w) => Board.view(w), model: (w) => Views.model(w), scenes: (w) => Views.scenes(w), scene: (w) => Views.scene(w), replay: (w) => Replay.view(w) };

  async function show() {
    const mine = ++turn;
    const [name, query] = location.hash.slice(1).split(/\?(.*)/s);
    const view = name || "board";
    const place = document.getElementById("content");
    const focused = keyOf(document.activeElement);
    Replay.stop();
    let parts;
    try {
      parts = await (Object.hasOwn(VIEWS, view) ? VIEWS[view](new URLSearchParams(query || "")) : Views.unknown("page", view));
    } catch (error) {
      parts = [el("h1", {}, "This cannot be shown"), el("p", { class: "notice" }, error.message)];
    }
    // A later choice may have been quicker.
    if (mine !== turn) return;
    const isSame = root.dataset.shown === view;
    place.replaceChildren(...parts);
    root.dataset.shown = view;
    for (const link of document.querySelectorAll(".top nav a")) {
      if (link.hash === `#${view}`) link.setAttribute("aria-current", "page");
      else link.removeAttribute("aria-current");
    }
    document.title = [...new Set([place.querySelector("h1")?.textContent, root.dataset.title])].filter(Boolean).join(" · ");
    Replay.draw(place);
    if (!isSame) {
      window.scrollTo(0, 0);
      if (mine > 1) place.focus({ preventScroll: true });
    } else if (focused) {
      [...place.querySelectorAll("button, input, select")].find((one) => keyOf(one) === focused)?.focus();
    }
  }

  /** What tells a control from others, also once it was made again; "" for anything else. */
  function keyOf(one) {
    if (one?.dataset?.column) return `column ${one.dataset.column}`;
    if (one?.type === "checkbox") return `box ${one.value}`;
    return one?.matches("input, select") ? one.id : "";
  }

  function theme(name) {
    root.dataset.theme = name;
    document.getElementById("theme").setAttribute("aria-pressed", String(name === "dark"));
    Replay.draw(document.getElementById("content"));
  }

  function startTheme() {
    const dark = matchMedia("(prefers-color-scheme: dark)");
    document.getElementById("theme").addEventListener("click", () => {
      const name = (root.dataset.theme ? root.dataset.theme === "dark" : dark.matches) ? "light" : "dark";
      kept(THEME, name);
      theme(name);
    });
    const before = kept(THEME);
    if (before === "light" || before === "dark") theme(before);
    dark.addEventListener("change", () => Replay.draw(document.getElementById("content")));
  }

  function onKey(event) {
    const { player } = Replay;
    if (!player || event.ctrlKey || event.metaKey || event.altKey || event.target.matches("input, select, textarea, button, summary, a")) return;
    const by = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (by) {
      player.stop();
      player.seek(player.at + by);
    } else if (event.key === " ") player.toggle();
    else return;
    event.preventDefault();
  }

  function start() {
    startTheme();
    document.addEventListener("keydown", onKey);
    document.querySelector(".skip").addEventListener("click", (event) => {
      event.preventDefault();
      document.getElementById("content").focus();
    });
    addEventListener("hashchange", show);
    let waiting = 0;
    addEventListener("resize", () => {
      cancelAnimationFrame(waiting);
      waiting = requestAnimationFrame(() => Replay.draw(document.getElementById("content")));
    });
    show();
  }

  return { address, wordsOf, go, kept, start };
})();

Site.start();
