/* Picks as rows of number fields: typed, stepped by buttons and keys, moved, removed. What is no
   number is said at its field for as long as it is none; no unit is ever guessed. */
"use strict";

const Fields = (() => {
  const NUMBER = /^[+-]?(?:\d+(?:\.(\d*))?|\.(\d+))$/;
  const SIGNS = { degrees: "°" };
  const STEPS = { ArrowUp: ["step", 1], ArrowDown: ["step", -1], PageUp: ["leap", 1], PageDown: ["leap", -1] };

  /** {value} of a text, or {fault}: what is wrong with it. */
  function read(text, field) {
    const plain = text.trim().replace("\u2212", "-").replace(",", ".");
    if (!plain) return { fault: "Give a number." };
    const found = NUMBER.exec(plain);
    if (!found) return { fault: `Give a number alone, in ${field.unit}.` };
    const value = Number(plain), decimals = (found[1] || found[2] || "").length;
    if (Math.abs(value) > field.most) return { fault: `Give one from \u2212${field.most} to ${field.most}.` };
    if (decimals > field.decimals) return { fault: `Give ${Words.count(field.decimals, "decimal")} at most.` };
    return { value };
  }

  /** The texts of a pick at first. */
  const blank = (fields) => fields.map((field) => (field.start === null ? "" : String(field.start)));

  /**
   * The rows of `picks`. `head(pick, n)` shows which choice it is; `painted` is called when picks
   * have changed, with words where there is something to say, `leave` when the fields are left for
   * the next pick.
   */
  function rows(picks, question, { head, painted, leave }) {
    const { fields, noun } = question;
    const list = el("ol", { class: "entries", "aria-label": "Your answer so far" });
    const inputs = () => [...list.querySelectorAll("input")];
    /** Fields at which a fault was said: a row that is made anew says it again. */
    const told = new Set();
    /** Whether an answer was held back for its faults: Enter goes from one to the next then. */
    let isMending = false;

    function paint() {
      list.replaceChildren(...picks.list.map(row));
    }

    function row(pick, n) {
      const act = (text, name, does, isOff = false) => el("button", {
        type: "button", class: "quiet", "aria-label": `${name} ${noun} ${n + 1}`, title: name, onclick: does, disabled: isOff,
      }, text);
      const name = `${noun} ${n + 1}: ${question.choices[pick.place].name}`;
      return el("li", {}, el("div", { role: "group", "aria-label": name },
        el("div", { class: "entry-head" }, head(pick, n),
          act("↑", "Move up", () => move(n, -1, "Move up"), n === 0),
          act("↓", "Move down", () => move(n, 1, "Move down"), n === picks.list.length - 1),
          act("✕", "Remove", () => remove(n))),
        el("div", { class: "fields" }, fields.map((field, k) => control(pick, n, field, k)))));
    }

    function control(pick, n, field, k) {
      const id = `field-${n}-${k}`;
      const fault = el("p", { class: "fault", id: `${id}-fault` });
      let isMarked = false;
      const input = el("input", {
        id, type: "text", role: "spinbutton", autocomplete: "off", "aria-valuemin": -field.most, "aria-valuemax": field.most,
        "aria-describedby": fault.id, value: pick.texts[k],
        onfocus: () => { isMarked = false; },
        oninput: () => change(input.value),
        // A field that nobody has come to yet may stay empty until the answer is given.
        onblur: () => (input.value.trim() || told.has(input.key)) && tell(input),
        onkeydown: (event) => onKey(event, n, (kind, sign) => step(sign * field[kind])),
      });
      const step = (by) => {
        // A text that is no number is not stepped away: it is said to be none.
        const from = input.value.trim() ? read(input.value, field).value : 0;
        if (from !== undefined) {
          const to = Math.max(-field.most, Math.min(field.most, from + by));
          change(String(Number(to.toFixed(field.decimals))));
        }
        tell(input);
      };
      const change = (text) => {
        if (!isMarked) picks.mark();
        isMarked = true;
        input.value = pick.texts[k] = text;
        picks.keep();
        if (input.getAttribute("aria-invalid")) tell(input);
        valueNow();
        painted();
      };
      const valueNow = () => {
        const { value } = read(input.value, field);
        if (value === undefined) input.removeAttribute("aria-valuenow");
        else input.setAttribute("aria-valuenow", value);
      };
      const button = (text, name, by) => el("button", {
        type: "button", class: "quiet", tabindex: "-1", "aria-label": `${name} ${field.name} of ${noun} ${n + 1}`,
        onclick: () => {
          isMarked = false;
          step(by);
        },
      }, text);
      Object.assign(input, { field, fault, key: `${pick.id}.${k}`, name: `${field.name} of ${noun} ${n + 1}` });
      if (told.has(input.key)) say(input);
      valueNow();
      return el("div", { class: "field" },
        el("label", { for: id }, `${field.name}, ${SIGNS[field.unit] || field.unit}`),
        el("span", { class: "stepper" }, button("−", "Less", -field.step), input, button("+", "More", field.step)),
        fault);
    }

    /** Say at a field what is wrong with it; whether anything is. */
    function say(input) {
      const { fault } = read(input.value, input.field);
      if (fault) input.setAttribute("aria-invalid", "true");
      else input.removeAttribute("aria-invalid");
      if (fault) told.add(input.key);
      input.fault.textContent = fault || "";
      return Boolean(fault);
    }

    /** The same, and aloud where it is news. */
    function tell(input) {
      const before = input.fault.textContent;
      const isNews = input.isConnected && say(input) && input.fault.textContent !== before;
      if (isNews) painted(`${input.name}: ${input.fault.textContent}`);
    }

    const isWrong = (input) => Boolean(read(input.value, input.field).fault);

    /** How many numbers hold an answer back that was to be given, in words; "" where none does. */
    function faults() {
      const count = isMending ? inputs().filter(isWrong).length : 0;
      return count ? `${Words.count(count, "number")} missing or wrong` : "";
    }

    function goTo(input) {
      input.focus();
      input.select();
    }

    /** Go on to the next fault behind a field, from the last to the first; leave where none is. */
    function goOn(from) {
      if (isWrong(from)) return tell(from);
      const all = inputs(), here = all.indexOf(from);
      const next = [...all.slice(here), ...all.slice(0, here)].find(isWrong);
      if (next) return goTo(next);
      isMending = false;
      leave();
      painted("All numbers are there, Ctrl+Enter submits");
    }

    function onKey(event, n, stepped) {
      if (event.ctrlKey || event.metaKey) return;
      const taken = (act) => {
        event.preventDefault();
        act();
      };
      if (event.altKey && event.key === "ArrowUp") return taken(() => move(n, -1));
      if (event.altKey && event.key === "ArrowDown") return taken(() => move(n, 1));
      if (STEPS[event.key]) return taken(() => stepped(...STEPS[event.key]));
      if (event.key === "Escape") return taken(leave);
      if (event.key !== "Enter") return;
      if (isMending) return taken(() => goOn(event.target));
      const all = inputs(), next = all.indexOf(event.target) + 1;
      // Behind the last field of a step comes the next pick.
      return taken(() => (next % fields.length ? goTo(all[next]) : leave()));
    }

    function move(n, by, focused = "") {
      const to = n + by;
      if (to < 0 || to >= picks.list.length) return;
      const column = inputs().indexOf(document.activeElement) % fields.length;
      picks.change((all) => all.splice(to, 0, ...all.splice(n, 1)));
      paint();
      const moved = list.children[to];
      const again = focused ? moved.querySelector(`[title="${focused}"]:enabled`) : moved.querySelectorAll("input")[column];
      (again || moved.querySelector("button:enabled")).focus();
      painted(`${noun} ${n + 1} is ${noun} ${to + 1} now`);
    }

    function remove(n) {
      picks.change((all) => all.splice(n, 1));
      paint();
      (list.children[Math.min(n, picks.list.length - 1)]?.querySelector("[title=Remove]") || { focus: leave }).focus();
      painted(`Removed ${noun} ${n + 1}`);
    }

    /** Numbers of every pick; null where a field is wrong, which is said and gone to. */
    function numbers() {
      const wrong = inputs().filter(say);
      isMending = wrong.length > 0;
      if (isMending) goTo(wrong[0]);
      return isMending ? null : picks.list.map((pick) => pick.texts.map((text, k) => read(text, fields[k]).value));
    }

    /** Bring the last pick into sight, and into its first field if that is to be `typed` into. */
    function enter(typed) {
      const last = list.lastElementChild;
      last.scrollIntoView({ block: "nearest" });
      if (typed) last.querySelector("input").focus({ preventScroll: true });
    }

    return { list, paint, numbers, faults, enter };
  }

  return { rows, blank };
})();
