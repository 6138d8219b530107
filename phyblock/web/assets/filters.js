/* Which samples are listed, and in which order: the form, and its words in the address. */
"use strict";

const Filters = (() => {
  const ORDERS = { name: "Name", model: "Model", worst: "Worst first", best: "Best first" };
  const state = { track: 0, order: "name", text: "", inReplies: false };
  const chosen = {};
  const settings = {};
  let fields = {};
  let form, changed;

  function start(onChange) {
    changed = onChange;
    form = document.getElementById("filters");
    const place = document.getElementById("tracks");
    place.hidden = Data.index.tracks.length < 2;
    place.replaceChildren(...Data.index.tracks.map((track, i) => el("button", {
      type: "button", "data-track": track,
      onclick: () => {
        setTrack(i);
        changed({ isNewTrack: true });
      },
    }, Data.index.track_titles[i])));
    setTrack(0);
  }

  function setTrack(i) {
    state.track = i;
    document.querySelectorAll("#tracks button").forEach((button, k) =>
      button.setAttribute("aria-pressed", String(k === i)));
    refit();
  }

  /** By what score a track's samples are listed: the one chosen for it, else its first. */
  const listing = (track = state.track) => {
    const known = Data.index.listings[track] || [];
    return known.find(({ name }) => name === settings[track]) || known[0] || null;
  };

  /** Whether a row of the chosen track has a value in a column. */
  const hasValue = (column) => column.some((value, row) =>
    value !== null && Data.index.rows.track[row] === state.track);

  /** List the chosen track by another score, whose wrong steps may have other types. */
  function setSetting(name) {
    settings[state.track] = name;
    refit();
  }

  /** Make the fields of what is listed now; what was chosen and is no more is let go. */
  function refit() {
    fields = fieldsOfTrack();
    for (const name of Object.keys(chosen)) {
      const option = find(name, chosen[name].word);
      if (option) chosen[name] = option;
      else delete chosen[name];
    }
    build();
  }

  const numbered = (names, label = (name) => name) =>
    names.map((name, value) => ({ word: String(name), value, label: label(name) }));

  /** By name in the address: what the field is called, and its options with their words. */
  function fieldsOfTrack() {
    const { index } = Data;
    const levels = [...new Set(index.items.levels.flat())].sort();
    const listed = listing(), known = index.listings[state.track] || [];
    const hasScores = listed !== null && hasValue(index.rows.scores[listed.name].tp);
    const hasParts = hasValue(index.rows.item.map((item) => index.items.subtask[item]));
    const means = Object.entries(index.subtask_groups).map(([word, { title, of }]) =>
      ({ word, value: of.map((name) => index.subtasks.indexOf(name)), label: `${title}: ${of.join(", ")}` }));
    const all = {
      model: ["Model", numbered(index.models)],
      level: levels.length > 1 && ["Level", levels.map((n) => ({ word: String(n), value: n, label: `Level ${n}` }))],
      subtask: hasParts && ["Subtask", [
        ...numbered(index.subtasks, (name) => `${name} ${index.subtask_names[name] || ""}`), ...means]],
      answer: hasValue(index.rows.correct) && ["Answer", [
        { word: "right", value: 1, label: "Right" }, { word: "wrong", value: 0, label: "Wrong" }]],
      outcome: ["Outcome", numbered(index.outcomes, Words.named)],
      error: hasScores && ["Error type", numbered(listed.errors, Words.named)],
      seed: index.seeds.length > 1 && ["Seed", index.seeds.map((n) => ({ word: String(n), value: n, label: `Seed ${n}` }))],
      variant: index.variants.length > 1 && ["Asked", index.variants.map((name, value) =>
        ({ word: name || "reference", value, label: name || "As the reference" }))],
      setting: hasScores && known.length > 1 && ["Setting", numbered(known.map(({ name }) => name))],
    };
    return Object.fromEntries(Object.entries(all).filter(([, field]) => field));
  }

  const find = (name, word) => fields[name]?.[1].find((option) => option.word === word);

  function build() {
    const made = Object.entries(fields).map(([name, [label, options]]) => field(name, label, options));
    form.replaceChildren(searchField(), ...made, orderField());
  }

  function field(name, label, options) {
    const isSetting = name === "setting";
    const now = isSetting ? listing().name : chosen[name]?.word;
    const select = el("select", {
      id: `filter-${name}`,
      onchange: () => {
        if (isSetting) setSetting(select.value);
        else if (select.value) chosen[name] = find(name, select.value);
        else delete chosen[name];
        changed({ isSetting });
      },
    }, isSetting ? null : el("option", { value: "" }, "All"),
    options.map(({ word, label: text }) => el("option", { value: word, selected: word === now }, text)));
    return el("label", {}, el("span", {}, label), select);
  }

  function searchField() {
    return el("label", { class: "wide" }, el("span", {}, "Search names and models; Enter: replies too"),
      el("input", {
        type: "search", id: "search", value: state.text, autocomplete: "off", spellcheck: "false",
        oninput: (event) => {
          state.text = event.target.value;
          state.inReplies = false;
          changed({});
        },
        onkeydown: (event) => {
          if (event.key !== "Enter") return;
          event.preventDefault();
          state.inReplies = Boolean(words(state.text).length);
          changed({});
        },
      }));
  }

  function orderField() {
    const select = el("select", {
      id: "filter-sort",
      onchange: () => {
        state.order = select.value;
        changed({});
      },
    }, Object.entries(ORDERS).map(([word, text]) => el("option", { value: word, selected: word === state.order }, text)));
    return el("label", {}, el("span", {}, "Order"), select);
  }

  const words = (text) => text.toLowerCase().split(/\s+/).filter(Boolean);

  /** A function of a row: whether it passes. `replies` are rows whose reply holds the search. */
  function test(replies) {
    const { rows: columns, items } = Data.index;
    const checks = [(row) => columns.track[row] === state.track];
    const of = (name) => chosen[name] && chosen[name].value;
    for (const name of ["model", "outcome", "seed", "variant"]) {
      const value = of(name), column = columns[name];
      if (value !== undefined) checks.push((row) => column[row] === value);
    }
    const level = of("level"), answer = of("answer"), error = of("error");
    if (level !== undefined) checks.push((row) => items.levels[columns.item[row]].includes(level));
    if (answer !== undefined) checks.push((row) => columns.correct[row] === answer);
    if (of("subtask") !== undefined) {
      const parts = new Set([of("subtask")].flat());
      checks.push((row) => parts.has(items.subtask[columns.item[row]]));
    }
    if (error !== undefined) {
      const wrong = columns.scores[listing().name].wrong;
      checks.push((row) => (wrong[row] || 0) >> error & 1);
    }
    if (words(state.text).length) checks.push(named(words(state.text), replies));
    return (row) => checks.every((check) => check(row));
  }

  function named(wanted, replies) {
    const { rows: columns, items, scenes, models } = Data.index;
    const lower = (text) => text.toLowerCase();
    const ofItem = items.key.map((key, i) => lower(`${key} ${scenes[items.scene[i]]}`));
    const ofModel = models.map(lower);
    const inItem = wanted.map((word) => ofItem.map((text) => text.includes(word)));
    const inModel = wanted.map((word) => ofModel.map((text) => text.includes(word)));
    return (row) => replies?.has(row)
      || wanted.every((_, n) => inItem[n][columns.item[row]] || inModel[n][columns.model[row]]);
  }

  /** What the address says of filters: all that is not as it is at first. */
  function asked() {
    const { tracks, listings } = Data.index;
    return {
      track: tracks.length > 1 ? tracks[state.track] : "",
      ...Object.fromEntries(Object.entries(chosen).map(([name, option]) => [name, option.word])),
      setting: listing() === (listings[state.track]?.[0] || null) ? "" : listing().name,
      order: state.order === "name" ? "" : state.order,
      q: state.text.trim(),
      in: state.inReplies ? "replies" : "",
    };
  }

  /** Take the words of an address; what it names that is not there comes back, in words. */
  function restore(given, row) {
    const { index } = Data;
    const unknown = [];
    const track = given.get("track");
    const place = track === null ? (row >= 0 ? index.rows.track[row] : state.track) : index.tracks.indexOf(track);
    if (place < 0) unknown.push(`track “${track}”`);
    for (const name of Object.keys(chosen)) delete chosen[name];
    for (const track of Object.keys(settings)) delete settings[track];
    setTrack(Math.max(0, place));
    const setting = given.get("setting");
    if (find("setting", setting)) setSetting(setting);
    for (const name of Object.keys(fields)) {
      const word = given.get(name);
      if (word === null) continue;
      const option = find(name, word);
      if (!option) unknown.push(`${fields[name][0].toLowerCase()} “${word}”`);
      else if (name !== "setting") chosen[name] = option;
    }
    const order = given.get("order") || "name";
    if (!Object.hasOwn(ORDERS, order)) unknown.push(`order “${order}”`);
    state.order = Object.hasOwn(ORDERS, order) ? order : "name";
    state.text = given.get("q") || "";
    state.inReplies = given.get("in") === "replies" && words(state.text).length > 0;
    build();
    return unknown;
  }

  /** Why nothing can pass, whatever else is chosen: the track, or the model in it, has no sample. */
  const lacking = () => Data.lacking(state.track) || (chosen.model ? Data.lacking(state.track, chosen.model.value) : "");

  return { start, setTrack, test, asked, restore, words, listing, lacking, state };
})();
