/* Models by items: every cell is what a model reached, by number and color, and leads to a sample.
   Only rows in sight exist. */
"use strict";

const Matrix = (() => {
  const ROW_PX = 30;
  const SPARE = 6;
  const ORDERS = { name: "Name", worst: "Hardest first", best: "Easiest first", split: "Most disputed first" };
  const state = { track: 0, order: "name" };
  const at = { row: 0, column: 0 };
  let cells = new Map();
  let items = [];
  let models = [];
  let box, body, head;

  function start() {
    if (box) return;
    box = document.getElementById("matrix");
    body = document.getElementById("matrix-rows");
    head = document.getElementById("matrix-head");
    const pick = (id, options, name) => {
      const select = el("select", {
        id, onchange: () => {
          state[name] = name === "track" ? Number(select.value) : select.value;
          make();
          Address.note();
        },
      }, Object.entries(options).map(([value, text]) => el("option", { value }, text)));
      return select;
    };
    document.getElementById("matrix-form").replaceChildren(
      ...(Data.index.tracks.length > 1 ? [el("label", {}, el("span", {}, "Track"), pick("matrix-track", { ...Data.index.track_titles }, "track"))] : []),
      el("label", {}, el("span", {}, "Order"), pick("matrix-order", ORDERS, "order")));
    box.addEventListener("scroll", () => requestAnimationFrame(paint), { passive: true });
    new ResizeObserver(paint).observe(box);
    box.addEventListener("keydown", onKey);
  }

  /** Sums of every model and item over seeds and ways of asking, and the worst sample of each. */
  function make() {
    const { rows } = Data.index;
    cells = new Map();
    const seen = new Map();
    for (let row = 0; row < rows.item.length; row++) {
      if (rows.track[row] !== state.track) continue;
      const item = rows.item[row], model = rows.model[row];
      if (!cells.has(item)) cells.set(item, new Map());
      const of = cells.get(item);
      if (!of.has(model)) of.set(model, { sum: 0, n: 0, row, least: Infinity, outcome: rows.outcome[row] });
      const cell = of.get(model), worth = List.worth(row);
      if (!seen.has(model)) seen.set(model, { sum: 0, n: 0 });
      if (worth === null) continue;
      cell.sum += worth;
      cell.n++;
      seen.get(model).sum += worth;
      seen.get(model).n++;
      if (worth < cell.least) Object.assign(cell, { least: worth, row });
    }
    const mean = ({ sum, n }) => (n ? sum / n : -1);
    models = [...seen.keys()].sort((a, b) => mean(seen.get(b)) - mean(seen.get(a)) || a - b);
    items = ordered([...cells.keys()]);
    Object.assign(at, { row: 0, column: 0 });
    body.style.height = `${items.length * ROW_PX}px`;
    box.style.setProperty("--models", models.length);
    box.setAttribute("aria-rowcount", items.length + 1);
    box.setAttribute("aria-colcount", models.length + 1);
    const why = Data.lacking(state.track) || unscored([...seen.values()]), none = document.getElementById("matrix-none");
    none.textContent = why;
    none.hidden = !why;
    box.hidden = Boolean(why);
    const { key, levels } = Data.index.items;
    const widest = items.reduce((most, item) => Math.max(most, `${key[item]} L${levels[item].join(", ")}`.length), 0);
    box.style.setProperty("--names", `${0.58 * widest + 0.6}rem`);
    const noun = Data.index.track_items[state.track] || "item";
    head.replaceChildren(el("span", { role: "columnheader", class: "matrix-corner" }, `${noun[0].toUpperCase()}${noun.slice(1)}`),
      ...models.map((model) => el("span", { role: "columnheader", class: "matrix-model" },
        el("span", { class: "matrix-name" }, Data.index.models[model]),
        el("span", { class: "number" }, seen.get(model).n ? Words.percent(mean(seen.get(model))) : "–"))));
    for (const name of ["track", "order"]) {
      const select = document.getElementById(`matrix-${name}`);
      if (select) select.value = String(state[name]);
    }
    paint();
  }

  /** Why there is nothing to show of a track whose samples are read and have no score of their own. */
  function unscored(sums) {
    const { rows, outcomes, track_titles: titles } = Data.index;
    const isRead = rows.track.some((track, row) => track === state.track && outcomes[rows.outcome[row]] === "ok");
    if (!isRead || sums.some(({ n }) => n)) return "";
    return `${titles[state.track]} gives single samples no score: its values are under Results, its replies under Samples.`;
  }

  function ordered(found) {
    const known = (item) => [...cells.get(item).values()].filter((cell) => cell.n).map((cell) => cell.sum / cell.n);
    const mean = (values) => (values.length ? values.reduce((a, b) => a + b, 0) / values.length : 0);
    const spread = (values) => mean(values.map((value) => (value - mean(values)) ** 2));
    const by = { worst: (v) => mean(v), best: (v) => -mean(v), split: (v) => -spread(v) }[state.order];
    if (!by) return found;
    const keys = new Map(found.map((item) => [item, by(known(item))]));
    return found.sort((a, b) => keys.get(a) - keys.get(b) || a - b);
  }

  function paint() {
    const top = box.scrollTop - body.offsetTop;
    const first = Math.max(0, Math.floor(top / ROW_PX) - SPARE);
    const last = Math.min(items.length, Math.ceil((top + box.clientHeight) / ROW_PX) + SPARE);
    const hadFocus = body.contains(document.activeElement);
    const made = [];
    for (let place = first; place < last; place++) made.push(line(place));
    body.replaceChildren(...made);
    if (hadFocus) focus(false);
  }

  function line(place) {
    const item = items[place];
    const { key, levels } = Data.index.items;
    const made = el("div", { class: "matrix-line", role: "row", "aria-rowindex": place + 2 },
      el("span", { role: "rowheader", class: "matrix-item" }, key[item],
        levels[item].length ? el("span", { class: "muted" }, ` L${levels[item].join(", ")}`) : null),
      models.map((model, column) => cell(cells.get(item).get(model), place, column)));
    made.style.top = `${place * ROW_PX}px`;
    return made;
  }

  function cell(found, place, column) {
    if (!found) return el("span", { role: "gridcell", class: "matrix-cell" }, "·");
    const sample = Data.sample(found.row);
    const share = found.n ? found.sum / found.n : null;
    const said = share === null ? Words.named(sample.outcome) : Math.round(100 * share);
    const link = el("a", {
      href: Address.text("samples", { track: sample.track, tab: "did", s: sample.id }),
      tabindex: place === at.row && column === at.column ? 0 : -1, "data-at": `${place}.${column}`,
      title: `${sample.key}, ${sample.model}: ${said}`,
    }, share === null ? "!" : String(said));
    const made = el("span", { role: "gridcell", "aria-colindex": column + 2, class: "matrix-cell" }, link);
    if (share !== null) made.dataset.tenth = String(Math.round(10 * share));
    return made;
  }

  function focus(isMoved) {
    if (isMoved) {
      const top = body.offsetTop + at.row * ROW_PX, under = body.offsetTop;
      if (top - under < box.scrollTop) box.scrollTop = top - under;
      else if (top + ROW_PX > box.scrollTop + box.clientHeight) box.scrollTop = top + ROW_PX - box.clientHeight;
      paint();
    }
    body.querySelector(`[data-at="${at.row}.${at.column}"]`)?.focus({ preventScroll: !isMoved });
  }

  function onKey(event) {
    const way = { ArrowDown: [1, 0], ArrowUp: [-1, 0], ArrowRight: [0, 1], ArrowLeft: [0, -1] }[event.key];
    if (!way || !body.contains(event.target)) return;
    event.preventDefault();
    const [row, column] = (event.target.dataset.at || "0.0").split(".").map(Number);
    at.row = Math.max(0, Math.min(items.length - 1, row + way[0]));
    at.column = Math.max(0, Math.min(models.length - 1, column + way[1]));
    focus(true);
  }

  /** Take the words of an address; what it names that is not there comes back, in words. */
  function restore(words) {
    start();
    const track = words.get("track"), order = words.get("order") || "name";
    const place = track === null ? 0 : Data.index.tracks.indexOf(track);
    state.track = Math.max(0, place);
    state.order = Object.hasOwn(ORDERS, order) ? order : "name";
    make();
    return [place < 0 ? `track “${track}”` : "", state.order !== order ? `order “${order}”` : ""].filter(Boolean);
  }

  const asked = () => ({
    track: Data.index && Data.index.tracks.length > 1 ? Data.index.tracks[state.track] : "",
    order: state.order === "name" ? "" : state.order,
  });

  return { restore, asked };
})();
