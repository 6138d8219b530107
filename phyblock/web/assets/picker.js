/* A question as a model is sent it, and an answer made by picking choices: by mouse, touch or keys. */
"use strict";

const Picker = (() => {
  const MOST_BUTTONS = 6;
  const MOST_KEPT = 100;
  const KEPT = "picks";

  /** Picks that were made of this question before the page was loaded again, with every state before. */
  function kept(key) {
    try {
      const found = JSON.parse(sessionStorage.getItem(KEPT));
      if (found?.key === key) return found;
    } catch {
      // Nothing that can be read is kept: it begins with nothing.
    }
    return { key, list: [], past: [] };
  }

  /**
   * Show `question` in `main`; `submit` takes the answer. The function that comes back takes keys.
   * `isExact` shows the prompt of the model from the start.
   *
   * A pick is {place, texts}: which choice, and the numbers that are typed for it.
   */
  function show(main, question, submit, isExact) {
    const { choices, fields, noun, most, least, repeats, messages } = question;
    const isOne = most === 1, hasFields = fields.length > 0;
    const picks = kept(`${location.pathname} ${question.number} ${question.turn}`);
    const pictures = messages.flatMap((one) => one.parts).filter((part) => part.picture);
    const spots = choices.map(() => []);
    let typed = "";

    const chips = el("ol", { class: "chips", "aria-label": isOne ? "Your answer" : "Your answer so far" });
    const typing = el("span", { class: "muted number" });
    const button = (text, act) => el("button", { type: "button", class: "quiet", onclick: act }, text);
    const [undo, clear] = [button("Undo", takeBack), button("Clear", () => change("All removed", (all) => all.splice(0)))];
    const done = el("button", { type: "submit" });
    // Beside number fields there is room for those alone that no picture shows.
    const buttons = choices.map((one, place) => (one.spots.length && (hasFields || choices.length > MOST_BUTTONS) ? null
      : el("button", { type: "button", class: "quiet choice", onclick: () => pick(place) }, el("b", {}, one.name), one.text && ` ${one.text}`)));
    const answer = el("form", { class: "card answer", "aria-label": "Your answer", tabindex: "-1", onsubmit: send },
      hasFields ? el("p", { class: "muted" }, `Each ${noun} that you pick asks for ${new Intl.ListFormat("en").format(fields.map((one) => one.name))}; ↑ ↓ change a number, PageUp and PageDown by more.`) : null,
      el("div", { class: "choices" }, buttons), chips, typing, el("div", { class: "acts" }, isOne ? null : [undo, clear], done));
    main.replaceChildren(
      el("h1", {}, el("span", { class: "unseen" }, question.number ? `Question ${question.number} of ${question.of}: ` : "Warm-up: "), question.task),
      el("div", { class: hasFields ? "task with-fields" : "task" }, el("div", { class: "shown" }, messages.map(figures)),
        el("div", { class: "side" }, answer, el("details", { open: isExact }, el("summary", {}, "The model's exact prompt"), messages.map(texts)))));
    lay();
    paint("");
    return onKey;

    // ---- the question

    /** The texts of a message as they are sent, with a word for each picture. */
    function texts({ role, parts }) {
      return [el("p", { class: "muted" }, role), parts.map((part) => el("pre", { class: "text" }, part.text ?? `[picture: ${part.label}]`))];
    }

    /** The pictures of a message; a text before one is its caption. */
    function figures({ parts }) {
      return parts.map((part, n) => (part.text === undefined ? figure(part, parts[n - 1]?.text ?? (pictures.length > 1 ? part.label : "")) : null));
    }

    function figure(part, caption) {
      const number = pictures.indexOf(part);
      const here = choices.flatMap((one, place) => one.spots.filter((spot) => spot.picture === number).map(({ box }) => ({ box, place })));
      const left = Math.min(1, ...here.map(({ box }) => box[0]));
      // A goal beside its candidates comes apart on a narrow screen: the same picture, cut in two of
      // one size and the line between them, which is shown where they stand side by side.
      const cuts = here.length && left > 0.5 ? [[0, 1 - left], [1 - left, left], [left, 1]] : [[0, 1]];
      const windows = cuts.map(([from, to], n) => {
        const share = to - from, isLine = cuts.length > 1 && n === 1;
        const alt = n ? "" : part.label === "composite" ? "The goal on the left, the candidates on the right" : `Picture: ${part.label}`;
        const image = el("img", { src: part.picture, alt, draggable: "false", style: { width: `${100 / share}%`, left: `${(-100 * from) / share}%` } });
        return el("div", { class: isLine ? "window line" : "window", style: { flexGrow: share, aspectRatio: `${part.width * share} / ${part.height}` } },
          here.length ? image : el("button", { type: "button", class: "enlarge", "aria-label": `Enlarge: ${part.label}`, onclick: () => enlarge(part) }, image), here.filter(({ box }) => box[0] >= from && box[0] < to).map(({ box, place }) => spot(place, box, from, share)));
      });
      const made = el("figure", {}, caption ? el("figcaption", { class: "muted" }, caption) : null, el("div", { class: "windows" }, windows));
      made.style.setProperty("--wide", part.width / part.height);
      return made;
    }

    /** A picture as large as the screen, until it is clicked or Escape is pressed. */
    function enlarge(part) {
      const image = el("img", { src: part.picture, alt: `Picture: ${part.label}`, width: part.width, height: part.height });
      const large = el("dialog", { "aria-label": part.label, onclick: () => large.close(), onclose: () => large.remove() },
        image, el("button", { type: "button", class: "quiet", autofocus: true }, "Close"));
      main.append(large);
      large.showModal();
    }

    function spot(place, [x, y, width, height], from, share) {
      const made = el("button", { type: "button", class: "spot", "data-place": place, onclick: () => pick(place), style: {
        left: `${(100 * (x - from)) / share}%`, top: `${100 * y}%`, width: `${(100 * width) / share}%`, height: `${100 * height}%` } });
      spots[place].push(made);
      return made;
    }

    function spotName(place) {
      return `${/^\d+$/.test(choices[place].name) ? "Candidate" : "Option"} ${choices[place].name}`;
    }

    // ---- picks

    /** Change the picks by a function, as one step that can be undone. */
    function change(words, act) {
      mark();
      act(picks.list);
      lay();
      paint(words);
    }

    function mark() {
      picks.past = [...picks.past, structuredClone(picks.list)].slice(-MOST_KEPT);
    }

    function pick(place) {
      typed = "";
      const { name } = choices[place];
      if (!isOne && !repeats && picks.list.some((one) => one.place === place)) return paint(`${name} is picked already`);
      if (!isOne && picks.list.length >= most) return paint("No more can be picked");
      change(isOne ? `Picked ${name}` : `${noun} ${picks.list.length + 1}: ${name}`, (all) => {
        if (isOne) all.length = 0;
        all.push({ place, texts: fields.map(() => "") });
      });
      return chips.lastElementChild?.scrollIntoView({ block: "nearest" });
    }

    function takeBack() {
      const isUndone = picks.past.length > 0;
      if (isUndone) picks.list = picks.past.pop();
      lay();
      paint(isUndone ? "Undone" : "Nothing to undo");
    }

    function send(event) {
      event.preventDefault();
      if (picks.list.length < least) return paint(`Pick ${least - picks.list.length} more first`);
      done.disabled = true;
      done.textContent = "Saving …";
      const numbers = picks.list.map((one) => one.texts.map(Number));
      return submit({ picks: picks.list.map((one) => one.place), ...(hasFields ? { numbers } : {}) });
    }

    /** Rebuild the list of picks. */
    function lay() {
      // A single pick that a button shows already need not be said twice.
      const isSaid = isOne && picks.list.every(({ place }) => buttons[place]);
      chips.replaceChildren(...(isSaid ? [] : picks.list.map(chip)));
    }

    function chip(one, n) {
      const { name, text, spots: [at] } = choices[one.place];
      const remove = el("button", { type: "button", class: "quiet", "aria-label": `Remove ${noun} ${n + 1}`, title: "Remove",
        onclick: () => change(`Removed ${noun} ${n + 1}`, (all) => all.splice(n, 1)) }, "✕");
      return el("li", {}, el("div", { class: "chip", role: "group", "aria-label": `${noun} ${n + 1}: ${name}` },
        isOne ? null : el("span", { class: "muted number" }, `${n + 1}.`), at && thumb(at), el("b", { class: "number" }, name), isOne && text ? ` ${text}` : null, remove),
      hasFields ? el("div", { class: "fields" }, fields.map((field, k) => entry(one, n, field, k))) : null);
    }

    function thumb({ picture, box: [x, y, width, height] }) {
      const at = (start, size) => (size < 1 ? `${(100 * start) / (1 - size)}%` : "0%");
      return el("span", { class: "thumb", "aria-hidden": "true", style: {
        backgroundImage: `url("${pictures[picture].picture}")`, backgroundSize: `${100 / width}% ${100 / height}%`,
        backgroundPosition: `${at(x, width)} ${at(y, height)}` } });
    }

    /** A number of a pick; the browser says what is wrong with it. */
    function entry(one, n, field, k) {
      let isMarked = false;
      const change = () => {
        if (!isMarked) mark();
        isMarked = true;
        one.texts[k] = input.value;
        paint("");
      };
      const input = el("input", { type: "number", required: true, min: -field.most, max: field.most, step: 10 ** -field.decimals, value: one.texts[k],
        oninput: change,
        onkeydown: (event) => {
          const by = { ArrowUp: field.step, ArrowDown: -field.step, PageUp: field.leap, PageDown: -field.leap }[event.key];
          if (by === undefined) return;
          event.preventDefault();
          const value = Math.max(-field.most, Math.min(field.most, Number(input.value) + by));
          input.value = String(Number(value.toFixed(field.decimals)));
          change();
        } });
      return el("label", {}, el("span", { class: "muted" }, `${field.name}, ${field.unit === "degrees" ? "°" : field.unit}`,
        el("span", { class: "unseen" }, ` of ${noun} ${n + 1}`)), input);
    }

    function paint(words) {
      sessionStorage.setItem(KEPT, JSON.stringify(picks));
      const places = picks.list.map((one) => one.place);
      undo.disabled = !picks.past.length;
      clear.disabled = !places.length;
      done.disabled = places.length < least;
      done.textContent = isOne || !places.length ? "Submit" : `Submit ${Words.count(places.length, noun)}`;
      typing.textContent = typed ? `${typed}_ Enter picks it` : "";
      choices.forEach((_, place) => {
        const at = places.flatMap((one, n) => (one === place ? [n + 1] : []));
        for (const one of spots[place]) {
          one.classList.toggle("picked", at.length > 0);
          one.replaceChildren(...(at.length ? [el("span", { class: "badge number" }, isOne ? "✓" : at.join(", "))] : []));
          one.setAttribute("aria-label", spotName(place) + (at.length ? `, picked as ${at.join(", ")}` : ""));
        }
        buttons[place]?.setAttribute("aria-pressed", String(at.length > 0));
      });
      if (words) document.getElementById("said").textContent = words;
    }

    // ---- keys

    /** Digits and letters name a choice; Enter ends a name that others begin with. */
    function onKey(event) {
      const { key, target } = event;
      const act = () => {
        if (key === "Enter" && event.ctrlKey) return () => answer.requestSubmit();
        if (event.ctrlKey || target.matches?.("input")) return null;
        const move = { ArrowLeft: -1, ArrowRight: 1, ArrowUp: -4, ArrowDown: 4 }[key];
        if (move && target.closest?.(".spot")) return () => spots[Number(target.closest(".spot").dataset.place) + move]?.[0].focus();
        if (key === "Backspace") return () => (typed ? retype(typed.slice(0, -1)) : takeBack());
        if (key === "Escape" && typed) return () => retype("");
        if (key === "Enter" && typed) return () => name(typed, true);
        return /^[0-9a-z]$/i.test(key) ? () => name(typed + key, false) : null;
      };
      const found = event.altKey || event.metaKey || main.querySelector("dialog") ? null : act();
      if (!found) return;
      event.preventDefault();
      found();
    }

    function retype(text) {
      typed = text;
      paint("");
    }

    function name(text, isWhole) {
      const names = choices.map((one) => one.name.toUpperCase()), wanted = text.toUpperCase();
      const begun = names.filter((one) => one.startsWith(wanted)), exact = names.indexOf(wanted);
      if (exact >= 0 && (isWhole || begun.length === 1)) return pick(exact);
      if (begun.length === 1 && (isWhole || wanted.length > 1)) return pick(names.indexOf(begun[0]));
      retype(begun.length ? text : "");
      return begun.length ? null : paint(`${text} is no choice`);
    }
  }

  return { show };
})();
