/* Filters, and the list of samples that pass them; only rows in sight exist. */
"use strict";

const List = (() => {
  const ROW_PX = 46;
  const SPARE = 6;
  const SORTS = { scene: "Name", model: "Model", worst: "Worst first", best: "Best first" };
  const state = { track: 0, setting: "", sort: "scene", chosen: -1 };
  const filters = {};
  let rows = [];
  let box, inner, status, onChoose, form;

  function start(choose) {
    onChoose = choose;
    box = document.getElementById("list");
    inner = document.getElementById("list-rows");
    status = document.getElementById("list-status");
    form = document.getElementById("filters");
    state.setting = Data.index.settings[0] || "";
    box.addEventListener("scroll", () => requestAnimationFrame(paint), { passive: true });
    new ResizeObserver(paint).observe(box);
    buildTracks();
    buildFilters();
    apply();
  }

  function buildTracks() {
    const place = document.getElementById("tracks");
    place.hidden = Data.index.tracks.length < 2;
    Data.index.tracks.forEach((track, i) => {
      const button = el("button", {
        type: "button", "aria-pressed": String(i === state.track), "data-track": track,
        onclick: () => {
          setTrack(i);
          apply();
          choose(rows.length ? rows[0] : -1);
        },
      }, Data.index.track_titles[i]);
      place.append(button);
    });
  }

  function setTrack(i) {
    state.track = i;
    document.querySelectorAll("#tracks button").forEach((button, k) =>
      button.setAttribute("aria-pressed", String(k === i)));
    buildFilters();
  }

  /** Whether a row of the chosen track has a value in a column. */
  const hasValue = (column) => column.some((value, row) =>
    value !== null && Data.index.rows.track[row] === state.track);

  /** What the chosen track asks about, where that is more than a scene. */
  function nounOfItems() {
    const { rows: columns, items, scenes, track_items: nouns } = Data.index;
    const isMore = columns.item.some((item, row) =>
      columns.track[row] === state.track && items.key[item] !== scenes[items.scene[item]]);
    const noun = nouns[state.track];
    return isMore ? `${noun[0].toUpperCase()}${noun.slice(1)} or scene` : "Scene";
  }

  function buildFilters() {
    const { index } = Data;
    const of = (values, label) => values.map((value, i) => [i, label ? label(value) : value]);
    Object.keys(filters).forEach((name) => delete filters[name]);
    const levels = [...new Set(index.items.levels.flat())].sort();
    const scores = index.rows.scores[state.setting];
    const hasScores = scores !== undefined && hasValue(scores.tp);
    const hasParts = hasValue(index.rows.item.map((item) => index.items.subtask[item]));
    const fields = [
      select("model", "Model", of(index.models)),
      levels.length > 1 && select("level", "Level", levels.map((level) => [level, `Level ${level}`])),
      hasParts && select("subtask", "Subtask", of(index.subtasks, (s) => `${s} ${index.subtask_names[s] || ""}`)),
      hasValue(index.rows.correct) && select("answer", "Answer", [[1, "Right"], [0, "Wrong"]]),
      select("outcome", "Outcome", of(index.outcomes, Words.named)),
      hasScores && select("error", "Error type", of(index.error_types, Words.named)),
      index.seeds.length > 1 && select("seed", "Seed", index.seeds.map((seed) => [seed, `Seed ${seed}`])),
      index.variants.length > 1 && select("variant", "Asked", of(index.variants, (name) => name || "As the reference")),
      hasScores && index.settings.length > 1 && settingField(),
      sortField(),
    ];
    form.replaceChildren(searchField(), ...fields.filter(Boolean));
  }

  function searchField() {
    return el("label", { class: "wide" }, el("span", {}, nounOfItems()),
      el("input", {
        type: "search", id: "search", placeholder: "Search", autocomplete: "off", spellcheck: "false",
        oninput: (event) => {
          filters.text = event.target.value.trim().toLowerCase();
          apply();
        },
      }));
  }

  function select(name, label, options) {
    const field = el("select", {
      id: `filter-${name}`,
      onchange: () => {
        filters[name] = field.value === "" ? undefined : Number(field.value);
        apply();
      },
    }, el("option", { value: "" }, "All"), options.map(([value, text]) => el("option", { value }, text)));
    return el("label", {}, el("span", {}, label), field);
  }

  function settingField() {
    const field = el("select", {
      id: "filter-setting",
      onchange: () => {
        state.setting = field.value;
        apply();
        choose(state.chosen);
      },
    }, Data.index.settings.map((setting) =>
      el("option", { value: setting, selected: setting === state.setting }, setting)));
    return el("label", {}, el("span", {}, "Setting"), field);
  }

  function sortField() {
    const field = el("select", {
      id: "filter-sort",
      onchange: () => {
        state.sort = field.value;
        apply();
      },
    }, Object.entries(SORTS).map(([value, text]) =>
      el("option", { value, selected: value === state.sort }, text)));
    return el("label", {}, el("span", {}, "Order"), field);
  }

  function passes(row) {
    const { rows: columns, items } = Data.index;
    const item = columns.item[row];
    if (columns.track[row] !== state.track) return false;
    if (filters.model !== undefined && columns.model[row] !== filters.model) return false;
    if (filters.level !== undefined && !items.levels[item].includes(filters.level)) return false;
    if (filters.outcome !== undefined && columns.outcome[row] !== filters.outcome) return false;
    if (filters.seed !== undefined && columns.seed[row] !== filters.seed) return false;
    if (filters.variant !== undefined && columns.variant[row] !== filters.variant) return false;
    if (filters.subtask !== undefined && items.subtask[item] !== filters.subtask) return false;
    if (filters.answer !== undefined && columns.correct[row] !== filters.answer) return false;
    if (filters.error !== undefined) {
      const scores = columns.scores[state.setting];
      if (!scores || !((scores.wrong[row] || 0) >> filters.error & 1)) return false;
    }
    if (!filters.text) return true;
    const scene = Data.index.scenes[items.scene[item]];
    return `${items.key[item]} ${scene}`.toLowerCase().includes(filters.text);
  }

  /** How good a sample is under the setting shown, 0 to 1. */
  function worth(row) {
    const { correct, scores } = Data.index.rows;
    if (correct[row] !== null) return correct[row];
    const columns = scores[state.setting];
    if (!columns || columns.tp[row] === null) return 0;
    const tp = columns.tp[row], whole = 2 * tp + columns.fp[row] + columns.fn[row];
    return whole ? (2 * tp) / whole : 0;
  }

  function apply() {
    const { rows: columns } = Data.index;
    rows = [];
    for (let row = 0; row < columns.item.length; row++) if (passes(row)) rows.push(row);
    if (state.sort === "model") rows.sort((a, b) => columns.model[a] - columns.model[b] || a - b);
    if (state.sort === "worst") rows.sort((a, b) => worth(a) - worth(b) || a - b);
    if (state.sort === "best") rows.sort((a, b) => worth(b) - worth(a) || a - b);
    status.textContent = rows.length ? Words.count(rows.length, "sample") : "No sample passes these filters.";
    inner.style.height = `${rows.length * ROW_PX}px`;
    inner.replaceChildren();
    reveal();
    paint();
  }

  function paint() {
    const first = Math.max(0, Math.floor(box.scrollTop / ROW_PX) - SPARE);
    const last = Math.min(rows.length, Math.ceil((box.scrollTop + box.clientHeight) / ROW_PX) + SPARE);
    const made = [];
    for (let place = first; place < last; place++) made.push(line(place));
    inner.replaceChildren(...made);
    const shown = rows.indexOf(state.chosen);
    const isPainted = shown >= first && shown < last;
    if (isPainted) box.setAttribute("aria-activedescendant", `row-${state.chosen}`);
    else box.removeAttribute("aria-activedescendant");
  }

  function line(place) {
    const sample = Data.sample(rows[place]);
    const made = el("div", {
      class: "row", role: "option", id: `row-${sample.row}`, "data-row": sample.row,
      "aria-selected": String(sample.row === state.chosen), "aria-posinset": place + 1,
      "aria-setsize": rows.length, onclick: () => choose(sample.row),
    },
    el("span", { class: "row-name" }, sample.key),
    mark(sample),
    el("span", { class: "row-model" }, sample.asked));
    made.style.top = `${place * ROW_PX}px`;
    return made;
  }

  function mark(sample) {
    if (sample.outcome !== "ok" && sample.outcome !== "truncated") {
      return el("span", { class: "row-mark muted" }, Words.named(sample.outcome));
    }
    if (sample.correct !== null) {
      return el("span", { class: `row-mark ${sample.correct ? "right" : "wrong"}` }, sample.correct ? "✓" : "✗");
    }
    const score = sample.scores[state.setting];
    if (!score) return el("span", { class: "row-mark" }, "–");
    const bar = el("span", { class: "bar" }, el("span", {}));
    bar.firstChild.style.width = `${100 * (score.f1 || 0)}%`;
    return el("span", { class: "row-mark", title: "F1 of this sample [%]" }, bar,
      el("span", { class: "number" }, Words.percent(score.f1)));
  }

  function reveal() {
    const place = rows.indexOf(state.chosen);
    if (place < 0) return;
    const top = place * ROW_PX;
    if (top < box.scrollTop) box.scrollTop = top;
    else if (top + ROW_PX > box.scrollTop + box.clientHeight) box.scrollTop = top + ROW_PX - box.clientHeight;
  }

  function choose(row) {
    state.chosen = row;
    reveal();
    paint();
    onChoose(row);
  }

  /** Go `by` samples on in the list. */
  function move(by) {
    if (!rows.length) return;
    const place = rows.indexOf(state.chosen);
    const next = place < 0 ? 0 : Math.min(rows.length - 1, Math.max(0, place + by));
    if (rows[next] !== state.chosen) choose(rows[next]);
  }

  /** Show a sample, in whatever track it is; filters that hide it are left as they are. */
  function show(row) {
    const track = Data.index.rows.track[row];
    if (track !== state.track) {
      setTrack(track);
      apply();
    }
    choose(row);
  }

  return {
    start, move, show, paint,
    first: () => (rows.length ? rows[0] : -1),
    get chosen() {
      return state.chosen;
    },
    get setting() {
      return state.setting;
    },
    place: () => [rows.indexOf(state.chosen), rows.length],
  };
})();
