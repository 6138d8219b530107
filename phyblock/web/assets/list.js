/* All samples: filters and search, the list of those that pass, of which only rows in sight exist, and
   beside it the one that is chosen. The address says everything. */
"use strict";

const List = (() => {
  const ROW_PX = 34;
  const SPARE = 8;
  const PAUSE_MS = 150;
  const ORDERS = [["", "Name"], ["model", "Model"], ["worst", "Worst first"], ["best", "Best first"]];
  const FILTERS = ["model", "level", "part", "outcome", "solved", "error", "seed", "way"];
  const isWide = () => matchMedia("(min-width: 60rem)").matches;
  const wordsIn = (text) => (text || "").toLowerCase().split(/\s+/).filter(Boolean);
  const search = { text: "", found: new Set(), share: 1 };
  let parts = null;
  let now = {};
  let rows = [];
  let lines = [];
  let chosen = -1;
  let shown = "";
  let waiting = 0;

  /** The elements of the view, which stay while another one is looked at. */
  function made() {
    const inner = el("div", { role: "presentation" });
    const list = el("div", { class: "list", role: "listbox", tabindex: 0, "aria-label": "Samples", onkeydown: onListKey }, inner);
    const find = el("input", { type: "search", id: "search", autocomplete: "off", spellcheck: "false",
      oninput: () => {
        clearTimeout(waiting);
        waiting = setTimeout(() => filter({ q: find.value.trim(), in: "" }), PAUSE_MS);
      },
      onkeydown: (event) => {
        if (event.key === "Escape") find.blur();
        if (event.key !== "Enter") return;
        clearTimeout(waiting);
        filter({ q: find.value.trim(), in: find.value.trim() ? "replies" : "" });
      } });
    const form = el("div", { class: "filters" }), status = el("p", { role: "status", class: "muted" });
    const title = el("h1", {}), tools = el("div", { class: "tools" });
    const detail = el("div", { class: "detail", tabindex: 0, role: "region", "aria-label": "The sample" });
    const button = (text, act, more = {}) => el("button", { type: "button", class: "quiet", onclick: act, ...more }, text);
    const frame = el("div", { class: "workspace" },
      el("aside", { "aria-label": "List of samples" }, el("h1", {}, "Samples"),
        el("label", { class: "choice" }, el("span", {}, "Find; Enter: in replies too"), find), form, status, list,
        el("p", { class: "keys muted" }, [["J", "K", "next, previous"], ["Space", "play"], ["←", "→", "step"], ["/", "search"]]
          .map((keys) => [keys.slice(0, -1).map((key) => el("kbd", {}, key)), ` ${keys.at(-1)} `]))),
      el("section", { "aria-label": "Sample" },
        el("div", { class: "bar-top" }, button("‹ List", () => go({ s: "" }, true), { class: "quiet back" }), title, tools,
          button("‹ Previous", () => move(-1)), button("Next ›", () => move(1))), detail));
    list.addEventListener("scroll", () => requestAnimationFrame(paint), { passive: true });
    // Once the list has a size, and again with another one.
    new ResizeObserver(reveal).observe(list);
    return { frame, inner, list, find, form, status, title, tools, detail };
  }

  /** Show what the address says. */
  async function view(words) {
    await Data.open();
    parts = parts || made();
    now = Object.fromEntries(words);
    const { find, form, frame, status } = parts, row = now.s ? Data.find(now.s) : -1;
    if (!now.track && row >= 0) now.track = Data.sample(row).track.name;
    const track = Data.trackOf(now.track), fields = fieldsOf(track);
    const unknown = [now.s && row < 0 && `sample “${now.s}”`, now.track && track.name !== now.track && `track “${now.track}”`];
    for (const [name, [label, options]] of Object.entries(fields)) {
      if (now[name] && !options.some(([word]) => word === now[name])) {
        unknown.push(`${label.toLowerCase()} “${now[name]}”`);
        delete now[name];
      }
    }
    const focused = document.activeElement?.id;
    if (document.activeElement !== find) find.value = now.q || "";
    form.replaceChildren(...Object.entries(fields).map(([name, [label, options]]) => choice(`filter-${name}`, label,
      name === "track" ? options : [["", "All"], ...options], now[name] || (name === "track" ? track.name : ""), (word) => filter({ [name]: word }))),
    choice("filter-order", "Order", ORDERS, now.order || "", (word) => filter({ order: word })));
    if (form.contains(document.activeElement) || focused?.startsWith("filter-")) document.getElementById(focused)?.focus();
    rows = sift(now);
    chosen = row < 0 && !now.s && isWide() ? rows[0] ?? -1 : row;
    group();
    const isOutside = chosen >= 0 && !rows.includes(chosen) ? " The sample shown does not pass them." : "";
    const place = Data.board.rows.findIndex(({ name }) => name === now.model);
    status.textContent = [rows.length ? `${Words.count(rows.length, "sample")}${isOutside && `.${isOutside}`}`
      : Data.lacking(track) || (place >= 0 && Data.lacking(track, place)) || `No sample passes these filters.${isOutside}`,
    search.share < 1 && now.in ? `${Math.round(100 * search.share)} % of the replies read` : ""].filter(Boolean).join("; ");
    frame.dataset.detail = now.s || (isWide() && chosen >= 0) ? "shown" : "hidden";
    parts.inner.style.height = `${lines.length * ROW_PX}px`;
    setTimeout(reveal);
    unknown.push(await showSample(track));
    return { parts: [frame], unknown: unknown.filter(Boolean) };
  }

  // ---- the sample

  /** Show the chosen sample, and another model's beside it; a name that is unknown comes back in words. */
  async function showSample(track) {
    const { title, tools, detail } = parts;
    if (chosen < 0) {
      shown = "";
      title.textContent = "Samples";
      tools.replaceChildren();
      detail.replaceChildren(el("p", { class: "notice" }, now.s ? `There is no sample “${now.s}”.` : "No sample is chosen."));
      return "";
    }
    const sample = Data.sample(chosen);
    const rivals = Data.index.rowsOfItem[sample.item].map(Data.sample)
      .filter((one) => one.entry !== sample.entry && one.seed === sample.seed && one.way === sample.way);
    const other = rivals.find(({ entry }) => entry.name === now.with);
    const key = [chosen, other?.row, now.setting].join();
    if (key !== shown) {
      shown = key;
      const record = await Data.entry("records", chosen), settings = Sample.settingsOf(record);
      const made = await Sample.parts(chosen, other?.row ?? -1, now.setting);
      // A later choice may have been quicker.
      if (shown !== key) return "";
      title.replaceChildren(el("a", { href: App.address("scene", { s: sample.scene }) }, sample.key), " ",
        el("a", { class: "muted", href: App.address("model", { m: sample.entry.name }) }, sample.name));
      tools.replaceChildren(
        settings.length > 1 ? choice("setting", "Setting", settings.map((name) => [name, name]), now.setting || settings[0], (word) => go({ setting: word })) : "",
        choice("compare", "Compare with", [["", "Nothing"], ...rivals.map(({ entry }) => [entry.name, entry.name])], other?.entry.name || "", (word) => go({ with: word })));
      detail.replaceChildren(...made);
      detail.scrollTop = 0;
      follow(Sample.player);
    }
    return now.with && !other ? `“${now.with}” beside this sample of ${track.title}` : "";
  }

  /** Take step and camera from the address, and note them there as they change. */
  function follow(player) {
    if (!player) return;
    const view = (now.view || "").split(",").map(Number);
    if (view.length === 2 && view.every(Number.isFinite)) player.look(...view);
    if (now.step) player.seek(Number(now.step) || 0);
    const first = player.at;
    player.listeners.push(() => App.note({
      step: player.at === first && !now.step ? "" : player.at,
      view: player.isHome ? "" : player.view.map(Math.round).join(","),
    }));
    // Once it is in the page and has a size.
    requestAnimationFrame(() => player.tell());
  }

  // ---- filters

  const go = (changes, isNew = false) => App.go("samples", { ...now, step: "", view: "", ...changes }, isNew);

  /** Change filters: where the sample shown does not pass them, the first that does is shown. */
  function filter(changes) {
    const next = { ...now, ...changes };
    if ("track" in changes) for (const name of [...FILTERS, "setting", "with"]) delete next[name];
    const found = sift(next);
    if (!found.includes(chosen)) next.s = found.length && isWide() ? Data.sample(found[0]).id : "";
    App.go("samples", { ...next, step: "", view: "" }, "track" in changes);
  }

  /** By name in the address: the label of a filter and its options [word, text]. */
  function fieldsOf(track) {
    const { index, board } = Data;
    const items = index.items.key.flatMap((_, item) => (index.tracks[index.items.track[item]] === track.name ? [item] : []));
    const of = (all) => [...new Set(all)].sort();
    const levels = of(items.flatMap((item) => index.items.levels[item])), known = of(items.map((item) => index.items.part[item]));
    const bits = items.flatMap((item) => index.rowsOfItem[item]).reduce((all, row) => all | index.rows.wrong[row], 0);
    const errors = index.errors.filter((_, n) => (bits >> n) & 1);
    const same = (all, text = (one) => one) => all.map((one) => [String(one), text(one)]);
    const groups = Object.entries(track.groups).map(([word, { title, of: names }]) => [word, `${title}: ${names.join(", ")}`]);
    const seeds = of(index.rows.seed);
    return Object.fromEntries(Object.entries({
      track: board.tracks.length > 1 && ["Track", board.tracks.map(({ name, title }) => [name, title])],
      model: ["Model", same(board.rows.filter((row) => row.facts[track.name]).map(({ name }) => name))],
      level: levels.length > 1 && ["Level", same(levels, (n) => `Level ${n}`)],
      part: known.some(Boolean) && ["Subtask", [...same(known, (name) => `${name} ${track.parts[name] || ""}`), ...groups]],
      outcome: ["Outcome", same(index.outcomes, Words.named)],
      solved: track.best !== null && ["Score", [["yes", "Full"], ["no", "Less"]]],
      error: errors.length && ["Error type", same(errors, Words.named)],
      seed: seeds.length > 1 && ["Seed", same(seeds, (n) => `Seed ${n}`)],
      way: index.ways.length > 1 && ["Asked", index.ways.map((name) => [name || "reference", name || "As the reference"])],
    }).filter(([, field]) => field));
  }

  /** Rows that pass the filters, in their order. */
  function sift(words) {
    const { index, board } = Data, { rows: columns, items } = index, track = Data.trackOf(words.track);
    const checks = [(row) => index.tracks[items.track[columns.item[row]]] === track.name];
    const add = (word, check) => word && checks.push(check);
    const places = { model: board.rows.findIndex(({ name }) => name === words.model), outcome: index.outcomes.indexOf(words.outcome),
      way: index.ways.indexOf(words.way === "reference" ? "" : words.way), error: index.errors.indexOf(words.error) };
    const inPart = track.groups[words.part]?.of || [words.part];
    add(words.model, (row) => columns.entry[row] === places.model);
    add(words.level, (row) => items.levels[columns.item[row]].includes(Number(words.level)));
    add(words.part, (row) => inPart.includes(items.part[columns.item[row]]));
    add(words.outcome, (row) => columns.outcome[row] === places.outcome);
    add(words.solved, (row) => (columns.score[row] === track.best) === (words.solved === "yes"));
    add(words.error, (row) => (columns.wrong[row] >> places.error) & 1);
    add(words.seed, (row) => columns.seed[row] === Number(words.seed));
    add(words.way, (row) => columns.way[row] === places.way);
    const wanted = wordsIn(words.q);
    if (wanted.length) {
      const ofItem = items.key.map((key, n) => `${key} ${index.scenes[items.scene[n]]}`.toLowerCase());
      const ofModel = board.rows.map(({ name }) => name.toLowerCase());
      if (words.in === "replies") searched(words.q.toLowerCase());
      checks.push((row) => (words.in === "replies" && search.found.has(row)) || wanted.every((word) =>
        ofItem[columns.item[row]].includes(word) || ofModel[columns.entry[row]].includes(word)));
    }
    const found = columns.item.flatMap((_, row) => (checks.every((check) => check(row)) ? [row] : []));
    const worth = (a, b) => Data.worse(columns.score[a], columns.score[b], track);
    const orders = { model: (a, b) => columns.entry[a] - columns.entry[b], worst: worth, best: (a, b) => worth(b, a) };
    const order = orders[words.order] || ((a, b) => columns.item[a] - columns.item[b]);
    return found.sort((a, b) => order(a, b) || a - b);
  }

  /** Read all replies, chunk by chunk, for those that hold a text. */
  async function searched(text) {
    if (search.text === text) return;
    Object.assign(search, { text, found: new Set(), share: 0 });
    const starts = Data.index.starts.records;
    for (const [n, start] of starts.entries()) {
      const entries = await Data.load(`records-${n}`);
      if (search.text !== text) return;
      entries.forEach(({ reply, turns }, i) => {
        const replies = turns ? turns.map((turn) => turn.reply) : [reply];
        if (replies.some((one) => one?.text?.toLowerCase().includes(text))) search.found.add(start + i);
      });
      search.share = (n + 1) / starts.length;
      if (now.q?.toLowerCase() === text && (n % 8 === 7 || search.share === 1)) filter({});
    }
  }

  // ---- the list

  /** By name, a heading for each item stands above its samples; headings are -1 - item. */
  function group() {
    const { item } = Data.index.rows;
    const isGrouped = !now.order && rows.length > new Set(rows.map((row) => item[row])).size;
    parts.list.classList.toggle("grouped", isGrouped);
    lines = isGrouped ? rows.flatMap((row, n) => (n && item[rows[n - 1]] === item[row] ? [row] : [-1 - item[row], row])) : rows;
  }

  function paint() {
    const { list, inner } = parts;
    const first = Math.max(0, Math.floor(list.scrollTop / ROW_PX) - SPARE);
    const last = Math.min(lines.length, Math.ceil((list.scrollTop + list.clientHeight) / ROW_PX) + SPARE);
    inner.replaceChildren(...lines.slice(first, last).map((line, n) => {
      const made = line < 0 ? heading(-1 - line) : option(line);
      made.style.top = `${(first + n) * ROW_PX}px`;
      return made;
    }));
    if (document.getElementById(`row-${chosen}`)) list.setAttribute("aria-activedescendant", `row-${chosen}`);
    else list.removeAttribute("aria-activedescendant");
  }

  function heading(item) {
    const { key, levels } = Data.index.items;
    return el("div", { class: "row group", role: "presentation" }, el("b", {}, key[item]),
      levels[item].length ? el("span", { class: "muted" }, ` level ${levels[item].join(", ")}`) : null);
  }

  function option(row) {
    const { key, name, outcome, score, track, id } = Data.sample(row);
    const isRead = ["ok", "truncated"].includes(outcome);
    return el("div", { class: "row", role: "option", id: `row-${row}`, "aria-selected": String(row === chosen),
      "aria-posinset": rows.indexOf(row) + 1, "aria-setsize": rows.length, onclick: () => go({ s: id }, true) },
    el("b", { class: "row-key" }, key), el("span", { class: "row-model" }, name),
    isRead ? Charts.score(score, track) : el("span", { class: "muted" }, Words.named(outcome)));
  }

  function reveal() {
    const place = lines.indexOf(chosen), { list } = parts;
    // The heading above comes into sight too.
    const top = Math.max(0, place - 1) * ROW_PX, bottom = (place + 1) * ROW_PX;
    if (place >= 0 && top < list.scrollTop) list.scrollTop = top;
    else if (place >= 0 && bottom > list.scrollTop + list.clientHeight) list.scrollTop = bottom - list.clientHeight;
    paint();
  }

  /** Go `by` samples on in the list; a key that is held down leaves one place in the history. */
  function move(by, isHeld = false) {
    const place = rows.indexOf(chosen), next = rows[place < 0 ? 0 : Math.min(rows.length - 1, Math.max(0, place + by))];
    if (next !== undefined && next !== chosen) go({ s: Data.sample(next).id }, !isHeld);
  }

  /** Arrows change the sample while the list has the focus, as in any list. */
  function onListKey(event) {
    const page = Math.max(1, Math.floor(parts.list.clientHeight / ROW_PX) - 1);
    const by = { ArrowDown: 1, ArrowUp: -1, PageDown: page, PageUp: -page, Home: -Infinity, End: Infinity }[event.key];
    if (by === undefined || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    move(by, event.repeat);
  }

  return { view, move };
})();
