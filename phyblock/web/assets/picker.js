/* A question as a model is sent it, and an answer made by picking choices: by mouse, touch or keys. */
"use strict";

const Picker = (() => {
  const MOST_BUTTONS = 6;

  /** Show `question` in `main`; `submit` takes the answer. What is given back takes keys. `isExact`
      shows the prompt of the model from the start. */
  function show(main, question, submit, isExact = false) {
    const key = `${location.pathname} ${question.number} ${question.turn}`;
    const isOne = question.most === 1;
    const hasFields = question.fields.length > 0;
    const picks = new Picks(key, (pick) => question.choices[pick.place] && pick.texts.length === question.fields.length);
    const typed = { text: "" };
    const spots = question.choices.map(() => []);
    const pictures = question.messages.flatMap((one) => one.parts).filter((part) => part.picture);

    const rows = hasFields ? Fields.rows(picks, question, { head: rowHead, painted: paint, leave }) : null;
    const chips = rows?.list || el("ol", { class: "chips", "aria-label": isOne ? "Your answer" : "Your answer so far" });
    const typing = el("span", { class: "typing muted number" });
    const undo = el("button", { type: "button", class: "quiet", onclick: takeBack }, "Undo");
    const clear = el("button", { type: "button", class: "quiet", onclick: takeAll }, "Clear");
    const done = el("button", { type: "button", class: "primary", onclick: send });
    const buttons = question.choices.map((choice, place) => {
      // Beside number fields there is room for those alone that no picture shows.
      const isShown = !choice.spots.length || (!hasFields && question.choices.length <= MOST_BUTTONS);
      return isShown ? choiceButton(choice, place) : null;
    });

    const hint = rows && el("p", { class: "hint muted" },
      `Each ${question.noun} that you pick asks for ${new Intl.ListFormat("en").format(question.fields.map((field) => field.name))}.`,
      el("span", { class: "keys" }, " Enter goes on, behind the last number to the next pick; ↑ ↓ change a number, PageUp and PageDown by more."));
    const answer = el(
      "section",
      { class: rows ? "answer entered" : "answer", "aria-label": "Your answer", tabindex: "-1" },
      hint,
      el("div", { class: "choices" }, buttons),
      el("div", { class: "given" }, chips, typing),
      el("div", { class: "acts" }, isOne ? null : [undo, clear], done),
    );
    main.classList.toggle("with-fields", hasFields);
    const prompt = el("details", { class: "exact", open: isExact ? true : null },
      el("summary", {}, "The model's exact prompt"), question.messages.map(text));
    main.replaceChildren(
      el("h1", { class: "task" }, el("span", { class: "unseen" }, `Question ${question.number} of ${question.of}: `), question.task),
      el("div", { class: "task-columns" },
        el("div", { class: "asked" }, el("div", { class: "message" }, question.messages.map(figures))),
        el("div", { class: "side" }, answer, prompt)),
    );
    repaint("");
    return onKey;

    /** The pictures of a message; what stands before one is its caption. */
    function figures(one) {
      return one.parts.flatMap((part, n) => (part.text !== undefined ? []
        : [figure(part, one.parts[n - 1]?.text ?? "")]));
    }

    /** The texts of a message as they are sent, with a word for each picture. */
    function text(one) {
      return el("div", { class: `sent ${one.role}` }, el("p", { class: "muted" }, one.role),
        one.parts.map((part) => el("p", { class: "text" }, part.text !== undefined ? part.text : `[picture: ${part.label}]`)));
    }

    function figure(part, caption) {
      const number = pictures.indexOf(part);
      const here = question.choices.flatMap((choice, place) =>
        choice.spots.filter((spot) => spot.picture === number).map((spot) => ({ ...spot, place })),
      );
      const left = Math.min(1, ...here.map((spot) => spot.box[0]));
      // A goal beside its candidates comes apart on a narrow screen: the same picture, cut in two of
      // one size and the line between them, which is shown where they stand side by side.
      const cuts = here.length && left > 0.5 ? [[0, 1 - left], [1 - left, left], [left, 1]] : [[0, 1]];
      const windows = cuts.map(([from, to], n) => {
        const share = to - from;
        const isLine = cuts.length > 1 && n === 1;
        const image = el("img", { src: part.picture, alt: n ? "" : alternative(part), draggable: "false" });
        const frame = el("div", { class: isLine ? "window line" : "window" }, image);
        frame.style.flexGrow = share;
        frame.style.aspectRatio = `${part.width * share} / ${part.height}`;
        image.style.width = `${100 / share}%`;
        image.style.left = `${(-100 * from) / share}%`;
        for (const spot of here.filter((one) => one.box[0] >= from && one.box[0] < to)) {
          const button = el("button", {
            type: "button", class: "spot", "data-place": spot.place,
            "aria-label": spotName(spot.place), onclick: (event) => pick(spot.place, event.pointerType),
          });
          const [x, y, width, height] = spot.box;
          Object.assign(button.style, {
            left: `${(100 * (x - from)) / share}%`, top: `${100 * y}%`,
            width: `${(100 * width) / share}%`, height: `${100 * height}%`,
          });
          spots[spot.place].push(button);
          frame.append(button);
        }
        return frame;
      });
      const made = el("figure", {}, caption ? el("figcaption", {}, caption) : null,
        el("div", { class: "windows" }, windows));
      made.style.setProperty("--wide", part.width / part.height);
      return made;
    }

    function alternative(part) {
      return { composite: "The goal on the left, the candidates on the right" }[part.label]
        || `Picture: ${part.label}`;
    }

    function spotName(place) {
      return /^\d+$/.test(question.choices[place].name)
        ? `Candidate ${question.choices[place].name}` : `Option ${question.choices[place].name}`;
    }

    function choiceButton(choice, place) {
      return el("button", { type: "button", class: "choice", "data-place": place, onclick: (event) => pick(place, event.pointerType) },
        el("b", {}, choice.name), choice.text ? ` ${choice.text}` : null);
    }

    function pick(place, pointer = "") {
      typed.text = "";
      const { list } = picks, { name } = question.choices[place];
      if (!isOne && !question.repeats && list.some((one) => one.place === place)) return paint(`${name} is picked already`);
      if (!isOne && list.length >= question.most) return paint("No more can be picked");
      picks.change((all) => {
        if (isOne) all.length = 0;
        all.push(picks.made(place, Fields.blank(question.fields)));
      });
      repaint(`${isOne ? "Picked" : `${question.noun} ${picks.list.length}:`} ${name}`);
      // A touch on a field opens a keyboard, which hides half the page: that is left to the person.
      rows?.enter(pointer !== "touch");
    }

    function takeBack() {
      const words = picks.undo() ? "Undone" : "Nothing to undo";
      rows?.paint();
      paint([words, rows?.faults()].filter(Boolean).join("; "));
    }

    function takeAll() {
      picks.change((all) => { all.length = 0; });
      repaint("All taken back");
    }

    /** Leave the fields: what is typed next names a choice. */
    function leave() {
      answer.focus({ preventScroll: true });
    }

    function send() {
      if (picks.list.length < question.least) {
        paint(`Pick ${question.least - picks.list.length} more first`);
        return;
      }
      const numbers = rows?.numbers();
      if (numbers === null) {
        paint(rows.faults());
        return;
      }
      done.disabled = true;
      done.textContent = "Saving …";
      submit({ picks: picks.list.map((one) => one.place), ...(rows ? { numbers } : {}) });
    }

    /** Paint after picks were added, taken or undone. */
    function repaint(words) {
      rows?.paint();
      paint(words);
    }

    function paint(words) {
      const places = picks.list.map((one) => one.place);
      // A single pick that a button shows already need not be said twice.
      const isSaid = isOne && places.every((place) => buttons[place]);
      if (!rows) chips.replaceChildren(...(isSaid ? [] : picks.list.map((one, n) => el("li", {}, chip(one, n)))));
      undo.disabled = !picks.past.length;
      clear.disabled = !places.length;
      done.disabled = places.length < question.least;
      done.textContent = isOne || !places.length ? "Submit" : `Submit ${Words.count(places.length, question.noun)}`;
      typing.textContent = typed.text ? `${typed.text}_ Enter picks it` : "";
      question.choices.forEach((_, place) => {
        const at = places.flatMap((one, n) => (one === place ? [n + 1] : []));
        for (const spot of spots[place]) {
          spot.classList.toggle("picked", at.length > 0);
          spot.replaceChildren(...(at.length ? [el("span", { class: "badge number" }, isOne ? "✓" : at.join(", "))] : []));
          spot.setAttribute("aria-label", spotName(place) + (at.length ? `, picked as ${at.join(", ")}` : ""));
        }
        buttons[place]?.setAttribute("aria-pressed", String(at.length > 0));
      });
      if (words) document.getElementById("said").textContent = words;
    }

    function rowHead(one, n) {
      return el("div", { class: "chip" }, chip(one, n));
    }

    function chip({ place }, n) {
      const choice = question.choices[place];
      const spot = choice.spots[0];
      const thumb = spot ? el("span", { class: "thumb", "aria-hidden": "true" }) : null;
      if (thumb) {
        const part = pictures[spot.picture];
        const [x, y, width, height] = spot.box;
        const at = (start, size) => (size < 1 ? `${(100 * start) / (1 - size)}%` : "0%");
        thumb.style.backgroundImage = `url("${part.picture}")`;
        thumb.style.backgroundSize = `${100 / width}% ${100 / height}%`;
        thumb.style.backgroundPosition = `${at(x, width)} ${at(y, height)}`;
      }
      return [isOne ? null : el("span", { class: "muted number" }, `${n + 1}.`), thumb,
        el("b", { class: "number" }, choice.name), isOne && choice.text ? ` ${choice.text}` : null];
    }

    /** Digits and letters name a choice; Enter ends a name that others begin with. */
    function onKey(event) {
      if (event.altKey || event.metaKey) return;
      if (event.key === "Enter" && event.ctrlKey) return taken(event, send);
      if (event.ctrlKey || event.target.matches?.("input")) return;
      const spot = event.target.closest?.(".spot");
      const move = { ArrowLeft: -1, ArrowRight: 1, ArrowUp: -4, ArrowDown: 4 }[event.key];
      if (spot && move) {
        const next = spots[Number(spot.dataset.place) + move]?.[0];
        return taken(event, () => next?.focus());
      }
      if (event.key === "Backspace") {
        return taken(event, () => (typed.text ? retype(typed.text.slice(0, -1)) : takeBack()));
      }
      if (event.key === "Escape" && typed.text) return taken(event, () => retype(""));
      if (event.key === "Enter" && typed.text) return taken(event, () => name(typed.text, true));
      if (/^[0-9a-z]$/i.test(event.key)) return taken(event, () => name(typed.text + event.key, false));
    }

    function taken(event, act) {
      event.preventDefault();
      act();
    }

    function retype(text) {
      typed.text = text;
      paint("");
    }

    function name(text, isWhole) {
      const wanted = text.toUpperCase();
      const names = question.choices.map((choice) => choice.name.toUpperCase());
      const begun = names.filter((one) => one.startsWith(wanted));
      const exact = names.indexOf(wanted);
      if (exact >= 0 && (isWhole || begun.length === 1)) return pick(exact);
      if (begun.length === 1 && (isWhole || wanted.length > 1)) return pick(names.indexOf(begun[0]));
      retype(begun.length ? text : "");
      if (!begun.length) paint(`${text} is no choice`);
    }
  }

  return { show };
})();
