/* The list of samples that pass the filters; only rows in sight exist. */
"use strict";

const List = (() => {
  const ROW_PX = 34;
  const SPARE = 8;
  const PAUSE_MS = 120;
  let chosen = -1;
  let rows = [];
  let lines = [];
  let isGrouped = false;
  let waiting = 0;
  let box, inner, status, onChoose;

  /** `choose(row, isNew)` is called when a sample is chosen; row -1: none is left. */
  function start(choose) {
    onChoose = choose;
    box = document.getElementById("list");
    inner = document.getElementById("list-rows");
    status = document.getElementById("list-status");
    box.addEventListener("scroll", () => requestAnimationFrame(paint), { passive: true });
    new ResizeObserver(paint).observe(box);
    box.addEventListener("keydown", onKey);
    Filters.start(changed);
  }

  /** Filters changed: where the sample shown does not pass them, the first that does is shown. */
  function changed({ isNewTrack, isSetting }) {
    sift();
    const isKept = !isNewTrack && rows.includes(chosen);
    if (!isKept) chosen = first();
    lay();
    clearTimeout(waiting);
    if (isNewTrack) onChoose(chosen, true);
    // While somebody types, only what they end at is shown.
    else if (!isKept || isSetting) waiting = setTimeout(() => onChoose(chosen, false), PAUSE_MS);
    else Address.soon();
  }

  const first = () => (rows.length ? rows[0] : -1);

  /** How good a sample is under the setting shown, 0 to 1; null where nothing says. */
  function worth(row) {
    const { correct, scores } = Data.index.rows;
    if (correct[row] !== null) return correct[row];
    const columns = scores[Filters.listing(Data.index.rows.track[row])?.name];
    if (!columns || columns.tp[row] === null) return null;
    const tp = columns.tp[row], whole = 2 * tp + columns.fp[row] + columns.fn[row];
    return whole ? (2 * tp) / whole : 0;
  }

  /** Find the rows that pass, in their order. */
  function sift() {
    const { rows: columns } = Data.index;
    const { text, inReplies, order } = Filters.state;
    const replies = inReplies ? Search.rows(text, heard) : null;
    const passes = Filters.test(replies);
    rows = [];
    for (let row = 0; row < columns.item.length; row++) if (passes(row)) rows.push(row);
    const value = (row) => worth(row) || 0;
    if (order === "model") rows.sort((a, b) => columns.model[a] - columns.model[b] || a - b);
    if (order === "worst") rows.sort((a, b) => value(a) - value(b) || a - b);
    if (order === "best") rows.sort((a, b) => value(b) - value(a) || a - b);
    group();
  }

  function lay() {
    say();
    inner.style.height = `${lines.length * ROW_PX}px`;
    reveal();
    paint();
  }

  /** By name, a heading for each item stands above its samples; headings are -1 - item. */
  function group() {
    const { item } = Data.index.rows;
    const items = new Set(rows.map((row) => item[row]));
    isGrouped = Filters.state.order === "name" && rows.length > items.size;
    if (!isGrouped) {
      lines = rows;
      return;
    }
    lines = [];
    let last = -1;
    for (const row of rows) {
      if (item[row] !== last) lines.push(-1 - item[row]);
      last = item[row];
      lines.push(row);
    }
  }

  /** More of the replies were read: what holds the text comes into the list. */
  function heard(share) {
    sift();
    const isKept = rows.includes(chosen);
    if (!isKept && share === 1) chosen = first();
    lay();
    if (share < 1) status.textContent += `; ${Math.round(100 * share)} % of the replies read`;
    else if (!isKept) onChoose(chosen, false);
  }

  function say() {
    const isOutside = chosen >= 0 && !rows.includes(chosen) ? " The sample shown does not pass them." : "";
    status.textContent = rows.length ? `${Words.count(rows.length, "sample")}${isOutside && `.${isOutside}`}`
      : Filters.lacking() || `No sample passes these filters.${isOutside}`;
  }

  function paint() {
    const first = Math.max(0, Math.floor(box.scrollTop / ROW_PX) - SPARE);
    const last = Math.min(lines.length, Math.ceil((box.scrollTop + box.clientHeight) / ROW_PX) + SPARE);
    const made = [];
    for (let place = first; place < last; place++) {
      made.push(lines[place] < 0 ? heading(-1 - lines[place]) : line(lines[place]));
      made[made.length - 1].style.top = `${place * ROW_PX}px`;
    }
    inner.replaceChildren(...made);
    const shown = lines.indexOf(chosen);
    const isPainted = chosen >= 0 && shown >= first && shown < last;
    if (isPainted) box.setAttribute("aria-activedescendant", `row-${chosen}`);
    else box.removeAttribute("aria-activedescendant");
  }

  function heading(item) {
    const { items } = Data.index;
    const levels = items.levels[item];
    return el("div", { class: "row group", role: "presentation" }, el("span", { class: "row-name" }, items.key[item]),
      levels.length ? el("span", { class: "muted" }, ` level ${levels.join(", ")}`) : null);
  }

  function line(row) {
    const sample = Data.sample(row);
    return el("div", {
      class: isGrouped ? "row within" : "row", role: "option", id: `row-${row}`, "data-row": row,
      "aria-selected": String(row === chosen), "aria-posinset": rows.indexOf(row) + 1,
      "aria-setsize": rows.length, onclick: () => pick(row, true),
    },
    el("span", { class: isGrouped ? "row-name unseen" : "row-name" }, sample.key),
    el("span", { class: "row-model" }, sample.asked),
    mark(sample));
  }

  function mark(sample) {
    if (sample.outcome !== "ok" && sample.outcome !== "truncated") {
      return el("span", { class: "row-mark muted" }, Words.named(sample.outcome));
    }
    if (sample.correct !== null) {
      return el("span", { class: `row-mark ${sample.correct ? "right" : "wrong"}` }, sample.correct ? "✓ right" : "✗ wrong");
    }
    const listed = Filters.listing(), score = listed && sample.scores[listed.name];
    if (!score) return el("span", { class: "row-mark" }, "–");
    const bar = el("span", { class: "bar" }, el("span", {}));
    bar.firstChild.style.width = `${100 * (score.f1 || 0)}%`;
    return el("span", { class: "row-mark", title: `F1 of this sample in setting ${listed.name} [%]` }, bar,
      el("span", { class: "number" }, Words.percent(score.f1)));
  }

  function reveal() {
    const place = lines.indexOf(chosen);
    if (place < 0 || chosen < 0) return;
    // The heading above comes into sight too.
    const top = Math.max(0, place - Number(isGrouped)) * ROW_PX, bottom = (place + 1) * ROW_PX;
    if (top < box.scrollTop) box.scrollTop = top;
    else if (bottom > box.scrollTop + box.clientHeight) box.scrollTop = bottom - box.clientHeight;
  }

  function pick(row, isNew) {
    clearTimeout(waiting);
    chosen = row;
    say();
    reveal();
    paint();
    onChoose(row, isNew);
  }

  /** Go `by` samples on in the list; a key that is held down leaves one place in the history. */
  function move(by, isHeld = false) {
    if (!rows.length) return;
    const place = rows.indexOf(chosen);
    const next = place < 0 ? 0 : Math.min(rows.length - 1, Math.max(0, place + by));
    if (rows[next] !== chosen) pick(rows[next], !isHeld);
  }

  /** Arrows change the sample while the list has the focus, as in any list. */
  function onKey(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const page = Math.max(1, Math.floor(box.clientHeight / ROW_PX) - 1);
    const by = { ArrowDown: 1, ArrowUp: -1, PageDown: page, PageUp: -page, Home: -Infinity, End: Infinity }[event.key];
    if (by === undefined) return;
    event.preventDefault();
    move(by, event.repeat);
  }

  /** List by the filters, with a sample marked that need not pass them; else maybe the first. */
  function set(row, orFirst) {
    clearTimeout(waiting);
    sift();
    chosen = row < 0 && orFirst ? first() : row;
    lay();
    return chosen;
  }

  return {
    start, move, pick, worth, set, first,
    get chosen() {
      return chosen;
    },
  };
})();
