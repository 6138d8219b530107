/* The assembly step by step: a drawing that can be turned, a filmstrip, play and scrub. */
"use strict";

const Stage = (() => {
  const PLAY_MS = 850;
  const THUMB_PX = 76;
  const HOME = [45, 22];
  const DEGREES_PER_PX = 0.5;

  const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const accent = () => style("--accent-rgb").split(",").map(Number);

  /** One clock for all panels of a sample: position 0 is nothing, `last` the end. */
  class Player {
    constructor(last) {
      this.last = last;
      this.at = last;
      this.view = [...HOME];
      this.timer = null;
      this.listeners = [];
    }

    seek(at) {
      this.at = Math.max(0, Math.min(this.last, at));
      this.tell();
    }

    tell() {
      this.listeners.forEach((listener) => listener(this));
    }

    get isPlaying() {
      return this.timer !== null;
    }

    toggle() {
      if (this.isPlaying) return this.stop();
      if (this.at >= this.last) this.at = 0;
      this.timer = setInterval(() => {
        if (this.at >= this.last) this.stop();
        else this.seek(this.at + 1);
      }, PLAY_MS);
      return this.tell();
    }

    stop() {
      clearInterval(this.timer);
      this.timer = null;
      this.tell();
    }
  }

  /** Buttons and slider of a player. */
  function controls(player, noun) {
    const play = el("button", { type: "button", class: "play", id: "play", onclick: () => player.toggle() });
    const slider = el("input", {
      type: "range", min: 0, max: player.last, step: 1, id: "scrub", "aria-label": "Step",
      oninput: () => {
        // Stopping tells all listeners, who put the slider back to where the player is.
        const at = Number(slider.value);
        player.stop();
        player.seek(at);
      },
    });
    const where = el("output", { class: "number" });
    const step = (by, text, name) => el("button", {
      type: "button", class: "quiet", "aria-label": name,
      onclick: () => {
        player.stop();
        player.seek(player.at + by);
      },
    }, text);
    player.listeners.push(() => {
      play.textContent = player.isPlaying ? "Pause" : "Play";
      slider.value = player.at;
      const steps = player.last - 1;
      where.textContent = player.at > steps ? "End" : `${noun} ${player.at} of ${steps}`;
    });
    return el("div", { class: "controls" }, step(-1, "‹", "One step back"), play,
      step(1, "›", "One step on"), slider, where);
  }

  /** The parts of one sample's panel: drawings with titles, what the step did, filmstrip. */
  function panel(run, player, noun = "Step") {
    const pictures = run.titles.map((title) => (
      { title, canvas: el("canvas", { class: "stage", role: "img" }) }));
    const said = el("div", { class: "said", "aria-live": "polite" });
    const strip = el("ol", { class: "strip" });
    const end = run.steps.length + 1;
    const local = () => (player.at >= player.last ? end : Math.min(player.at, end));
    run.steps.forEach((step, i) => strip.append(frame(step, i, player, noun)));
    pictures.forEach(({ canvas }) => turnable(canvas, player));
    player.listeners.push(() => {
      const at = local();
      strip.querySelectorAll("button").forEach((button, i) =>
        button.setAttribute("aria-current", String(i + 1 === at)));
      follow(strip, at);
      say(said, run, at, noun);
      pictures.forEach((picture, i) => paint(picture, run, i, at, player.view));
    });
    lazily(strip, run.steps);
    return { pictures: run.framed ? pictures : [], said, strip };
  }

  function frame(step, i, player, noun) {
    const mark = step.why ? "✗" : "✓";
    const name = step.name ? `, ${step.name}` : "";
    return el("li", {}, el("button", {
      type: "button", class: step.why ? "wrong" : "right", "data-step": i + 1,
      title: `${noun} ${i + 1}: candidate ${step.number}${name}, ${step.verdict}`,
      onclick: () => {
        player.stop();
        player.seek(i + 1);
      },
    },
    step.thumb ? el("canvas", { class: "thumb", "aria-hidden": "true" }) : null,
    el("span", { class: "strip-head" }, el("span", { class: "number" }, String(i + 1)),
      el("span", { class: "mark" }, mark)),
    el("span", { class: "strip-what" }, step.label),
    el("span", { class: "unseen" }, `, candidate ${step.number}${name}, ${step.verdict}`)));
  }

  /** Frames are drawn when they come into sight. */
  function lazily(strip, steps) {
    const watch = new IntersectionObserver((seen) => {
      for (const { target, isIntersecting } of seen) if (isIntersecting) target.draw();
    }, { rootMargin: "200px" });
    strip.querySelectorAll("button").forEach((button, i) => {
      if (!steps[i].thumb) return;
      button.draw = () => {
        watch.unobserve(button);
        const { blocks, ...options } = steps[i].thumb;
        Solid.draw(button.querySelector("canvas"), blocks, { ...options, view: HOME, size: THUMB_PX, accent: accent() });
      };
      watch.observe(button);
    });
  }

  function paint({ canvas, title }, run, place, at, view) {
    const state = run.states[at] && run.states[at][place];
    if (!state) return;
    canvas.setAttribute("aria-label", `${title}: ${Words.count(state.blocks.length, "block")}`);
    Solid.draw(canvas, state.blocks, {
      ...state, view, framed: run.framed, accent: accent(), grid: style("--grid"),
    });
  }

  function say(said, run, at, noun) {
    if (at === 0) {
      said.replaceChildren(el("p", { class: "muted" }, "Nothing is placed yet."));
      return;
    }
    if (at > run.steps.length) {
      said.replaceChildren(el("p", {}, el("strong", {}, "End"), ` ${run.end}`));
      if (run.ghosts) said.append(el("p", { class: "muted" }, run.ghosts));
      return;
    }
    const step = run.steps[at - 1];
    const candidate = step.name ? `${step.number} (${step.name})` : step.number;
    const rows = [el("p", {}, el("strong", {}, `${noun} ${at}`),
      step.number === null || step.number === undefined ? " " : ` Candidate ${candidate} `,
      el("span", { class: step.why ? "verdict wrong" : "verdict right" }, `${step.why ? "✗" : "✓"} ${step.verdict}`))];
    if (step.text) rows.push(el("p", {}, step.text));
    if (step.note) rows.push(el("p", { class: "muted" }, step.note));
    said.replaceChildren(...rows);
  }

  function follow(strip, at) {
    const frame = strip.children[at - 1];
    if (!frame) return;
    const left = frame.offsetLeft;
    if (left < strip.scrollLeft || left + frame.offsetWidth > strip.scrollLeft + strip.clientWidth) {
      strip.scrollLeft = left - strip.clientWidth / 2;
    }
  }

  /** Drag to turn; a double click turns back. */
  function turnable(canvas, player) {
    let from = null;
    canvas.addEventListener("pointerdown", (event) => {
      from = [event.clientX, event.clientY, ...player.view];
      canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener("pointermove", (event) => {
      if (!from) return;
      const [x, y, azimuth, elevation] = from;
      const up = elevation + (event.clientY - y) * DEGREES_PER_PX;
      player.view = [azimuth - (event.clientX - x) * DEGREES_PER_PX, Math.max(2, Math.min(89, up))];
      player.tell();
    });
    for (const name of ["pointerup", "pointercancel"]) {
      canvas.addEventListener(name, () => {
        from = null;
      });
    }
    canvas.addEventListener("dblclick", () => {
      player.view = [...HOME];
      player.tell();
    });
  }

  /** A canvas that is drawn once it is in the page; see `draw`. */
  function picture(label, blocks, options, kind = "goal") {
    const canvas = el("canvas", { class: `picture ${kind}`, role: "img", "aria-label": label });
    canvas.drawing = [blocks, options];
    return canvas;
  }

  /** Draw every picture in sight of a place, after a change of size or colors too. */
  function draw(place) {
    for (const canvas of place?.querySelectorAll("canvas.picture") || []) {
      if (!canvas.clientWidth) continue;
      const [blocks, options] = canvas.drawing;
      const grid = options.grid ? style("--grid") : null;
      Solid.draw(canvas, blocks, { view: HOME, ...options, grid, accent: accent() });
    }
  }

  return { Player, controls, panel, picture, draw, HOME, style, accent };
})();
