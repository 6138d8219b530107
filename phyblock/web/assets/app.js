/* The page: views, theme, keyboard, what the address says. */
"use strict";

(() => {
  const THEME = "phyblock-theme";
  const root = document.documentElement;
  const detail = document.getElementById("detail");
  const workspace = document.getElementById("workspace");
  const other = document.getElementById("compare");
  const title = document.getElementById("sample-title");
  const warning = document.getElementById("warning");
  let opened = null;

  function theme(name) {
    root.dataset.theme = name;
    document.getElementById("theme").setAttribute("aria-pressed", String(name === "dark"));
    Detail.drawn();
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
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", Detail.drawn);
  }

  /** What is seen, as an address. */
  function seen() {
    const view = root.dataset.shown;
    if (view === "results") return Address.text(view);
    if (view === "matrix") return Address.text(view, Matrix.asked());
    const sample = List.chosen >= 0 ? Data.sample(List.chosen) : null;
    return Address.text(view, {
      ...Filters.asked(), s: sample?.id, with: sample ? other.value : "", ...(sample ? Detail.asked() : {}),
      numbers: Overlay.hasNumbers ? "" : "off",
    });
  }

  function view(name) {
    for (const section of document.querySelectorAll("[data-view]")) section.hidden = section.dataset.view !== name;
    for (const link of document.querySelectorAll("nav a")) {
      if (link.hash === `#${name}`) link.setAttribute("aria-current", "page");
      else link.removeAttribute("aria-current");
    }
    root.dataset.shown = name;
    return name === "results" ? Promise.resolve() : open();
  }

  /** The index is read when the samples are first looked at. */
  function open() {
    opened = opened || Data.open().then(() => {
      List.start(choose);
      other.addEventListener("change", () => choose(List.chosen, false));
    }).catch((error) => {
      for (const place of [detail, document.getElementById("matrix-form")]) {
        place.replaceChildren(el("p", { class: "notice" }, error.message));
      }
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

  /** A person chose a sample: show it, and let the address say so. */
  function choose(row, isNew) {
    warn([]);
    const at = row === shownRow ? Detail.asked() : {};
    show(row, other.value, at.step === undefined || at.step === "" ? {} : { step: at.step });
    Address.note(isNew);
  }

  let shownRow = -1;

  function show(row, wanted, at) {
    shownRow = row;
    workspace.dataset.detail = row < 0 ? "hidden" : "shown";
    if (row < 0) {
      title.replaceChildren("Samples");
      other.replaceChildren(el("option", { value: "" }, "Nothing"));
      other.disabled = true;
      Detail.say("No sample is chosen.");
      return;
    }
    const sample = Data.sample(row);
    const open = rivals(sample);
    other.replaceChildren(el("option", { value: "" }, "Nothing"),
      ...open.map(([, name]) => el("option", { value: name, selected: name === wanted }, name)));
    other.disabled = !open.length;
    const beside = open.find(([, name]) => name === wanted);
    title.replaceChildren(el("span", { class: "title-key" }, sample.key),
      el("span", { class: "muted" }, sample.asked));
    detail.scrollTop = 0;
    Detail.show(detail, row, beside ? beside[0] : -1, Filters.listing(Data.index.rows.track[row]), at);
  }

  function warn(unknown) {
    warning.hidden = !unknown.length;
    warning.textContent = unknown.length ? `This run has nothing that the link names so: ${unknown.join("; ")}.` : "";
  }

  /** Show what the address names. */
  async function go() {
    Address.forget();
    const { view: name, words } = Address.read();
    const known = ["results", "matrix", "samples"].includes(name);
    await view(known ? name : "results");
    const unknown = known || name === "content" ? [] : [`view “${name}”`];
    if (name === "matrix") unknown.push(...Matrix.restore(words));
    if (name === "samples") unknown.push(...goToSamples(words));
    warn(unknown);
  }

  function goToSamples(words) {
    const id = words.get("s"), wanted = words.get("with") || "";
    const row = id === null ? -1 : Data.find(id);
    const unknown = Filters.restore(words, row);
    if (id !== null && row < 0) unknown.push(`sample “${id}”`);
    Overlay.hasNumbers = words.get("numbers") !== "off";
    document.getElementById("numbers").checked = Overlay.hasNumbers;
    const isWide = matchMedia("(min-width: 60rem)").matches;
    const first = List.set(row, id === null && isWide);
    const view = (words.get("view") || "").split(",").map(Number);
    const step = Number(words.get("step"));
    show(first, wanted, {
      tab: words.get("tab") || "",
      ...(view.length === 2 && view.every(Number.isFinite) ? { view: [view[0], Math.max(2, Math.min(89, view[1]))] } : {}),
      ...(words.has("step") && Number.isInteger(step) ? { step } : {}),
    });
    if (row >= 0 && wanted && other.value !== wanted) unknown.push(`“${wanted}” beside this sample`);
    if (id !== null && row < 0) Detail.say(`This run has no sample “${id}”.`);
    return unknown;
  }

  const keys = {
    j: (event) => List.move(1, event.repeat),
    k: (event) => List.move(-1, event.repeat),
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
    // Space keeps what it means on a button or a folded part.
    if (event.key === " " && on.matches("button, summary, a")) return;
    if (!Object.hasOwn(keys, event.key)) return;
    event.preventDefault();
    keys[event.key](event);
  }

  /** The main part of what is seen, past everything above it. */
  function skip(event) {
    event.preventDefault();
    const place = root.dataset.shown === "samples" ? detail : document.getElementById("content");
    place.focus();
    place.scrollIntoView();
  }

  /** On paper everything is open; what was closed is closed again afterwards. */
  function startPrint() {
    let opened = [], panels = [];
    addEventListener("beforeprint", () => {
      opened = [...document.querySelectorAll("details:not([open])")];
      panels = [...detail.querySelectorAll(".panel[hidden]")];
      opened.forEach((part) => part.setAttribute("open", ""));
      panels.forEach((panel) => panel.removeAttribute("hidden"));
      Detail.drawn(true);
      // Frames that were never in sight were never drawn.
      detail.querySelectorAll(".strip button").forEach((frame) => frame.draw?.());
    });
    addEventListener("afterprint", () => {
      opened.forEach((part) => part.removeAttribute("open"));
      panels.forEach((panel) => panel.setAttribute("hidden", ""));
    });
  }

  startTheme();
  startPrint();
  Results.start();
  open().then(Results.fill).catch(() => null);
  Address.start(seen);
  Detail.onTold(Address.soon);
  document.querySelector(".skip").addEventListener("click", skip);
  document.getElementById("previous").addEventListener("click", () => List.move(-1));
  document.getElementById("next").addEventListener("click", () => List.move(1));
  document.getElementById("back").addEventListener("click", () => List.pick(-1, true));
  document.getElementById("numbers").addEventListener("change", (event) => {
    Overlay.hasNumbers = event.target.checked;
    show(shownRow, other.value, { ...(Detail.player ? { step: Detail.player.at, view: Detail.player.view } : {}) });
    Address.soon();
  });
  document.addEventListener("keydown", onKey);
  addEventListener("hashchange", go);
  let waiting = 0;
  addEventListener("resize", () => {
    cancelAnimationFrame(waiting);
    waiting = requestAnimationFrame(() => Detail.drawn());
  });
  go();
})();
