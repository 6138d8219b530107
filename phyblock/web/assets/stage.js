/* The assembly step by step: drawings that turn together, a timeline, a filmstrip. */
"use strict";

const Stage = (() => {
  const PLAY_MS = 900;
  const DROP_MS = 250;
  const FALL_MS = 600;
  const DROP_M = 0.05;
  const THUMB_PX = 76;
  const BADGES_FROM_PX = 500;
  const HOME = [45, 22];
  const DEGREES_PER_PX = 0.5;
  const DEGREES_PER_KEY = 10;

  const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const rgb = (name) => style(name).split(",").map(Number);
  const isStill = () => matchMedia("(prefers-reduced-motion: reduce)").matches;
  const colors = () => ({ accent: rgb("--accent-rgb"), triedColor: rgb("--tried-rgb") });

  /** One clock and one camera for all drawings of a sample: position 0 is nothing, `last` the end. */
  class Player {
    constructor(last, wrong = []) {
      this.last = last;
      this.wrong = wrong;
      this.at = wrong.length ? wrong[0] : last;
      this.view = [...HOME];
      this.timer = null;
      this.listeners = [];
    }

    seek(at) {
      this.at = Math.max(0, Math.min(this.last, at));
      this.tell();
    }

    look(azimuth, elevation) {
      this.view = [azimuth, Math.max(2, Math.min(89, elevation))];
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

  /** Steps of some runs that went wrong, each once, the first one first. */
  const wrongSteps = (runs) => [...new Set(runs.flatMap(({ steps }) =>
    steps.flatMap((step, i) => (step.why ? [i + 1] : []))))].sort((a, b) => a - b);

  /** Buttons and timeline of a player; a tick stands under each step that went wrong. */
  function controls(player, noun) {
    const button = (text, name, act, more = {}) => el("button", { type: "button", class: "quiet", "aria-label": name, title: name, onclick: act, ...more }, text);
    const to = (at) => {
      player.stop();
      player.seek(at);
    };
    const play = button("Play", null, () => player.toggle(), { class: "play", id: "play" });
    const slider = el("input", {
      type: "range", min: 0, max: player.last, step: 1, id: "scrub", "aria-label": noun,
      // Stopping tells all listeners, who put the slider back to where the player is.
      oninput: () => to(Number(slider.value)),
    });
    const ticks = el("div", { class: "ticks", "aria-hidden": "true" }, player.wrong.map(() =>
      el("i", { class: "wrong-step" })));
    [...ticks.children].forEach((tick, i) => tick.style.setProperty("left", `${(100 * player.wrong[i]) / player.last}%`));
    const where = el("output", { class: "number" });
    const home = button("Reset view", "Turn back to the first view", () => player.look(...HOME));
    player.listeners.push(() => {
      play.textContent = player.isPlaying ? "Pause" : "Play";
      slider.value = player.at;
      const steps = player.last - 1;
      where.textContent = player.at > steps ? "End" : `${noun} ${player.at} of ${steps}`;
      home.hidden = player.view.every((angle, i) => angle === HOME[i]);
    });
    return el("div", { class: "controls" }, button("‹", "One step back", () => to(player.at - 1)), play,
      button("›", "One step on", () => to(player.at + 1)), el("div", { class: "timeline" }, slider, ticks), where, home);
  }

  /** The parts of one sample's panel: drawings with titles, what the step did, filmstrip. */
  function panel(run, player, noun, scene) {
    const pictures = run.titles.map((title) => ({
      title, at: null, moving: 0, canvas: el("canvas", { class: "stage", role: "img", tabindex: 0 }) }));
    const said = el("div", { class: "said", "aria-live": "polite" });
    const strip = el("ol", { class: "strip" });
    const end = run.steps.length + 1;
    run.steps.forEach((step, i) => strip.append(frame(step, i, player, noun)));
    pictures.forEach(({ canvas }) => turnable(canvas, player));
    player.listeners.push(() => {
      const at = player.at >= player.last ? end : Math.min(player.at, end);
      strip.querySelectorAll("button").forEach((button, i) =>
        button.setAttribute("aria-current", String(i + 1 === at)));
      follow(strip, at);
      say(said, run, at, noun);
      pictures.forEach((picture, i) => show(picture, run, i, at, player, scene));
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
        Solid.draw(button.querySelector("canvas"), blocks, { ...options, view: HOME, size: THUMB_PX, ...colors() });
      };
      watch.observe(button);
    });
  }

  /** Draw where the player stands; a step forward moves from the state before it. */
  function show(picture, run, place, at, player, scene) {
    const state = run.states[at]?.[place];
    if (!state || !picture.canvas.isConnected || !picture.canvas.clientWidth) return;
    const { canvas, title } = picture;
    canvas.setAttribute("aria-label", `${title}: ${Words.count(state.blocks.length, "block")}. Drag or use the arrow keys to turn it.`);
    const before = picture.at !== null && at === picture.at + 1 ? run.states[picture.at]?.[place] : null;
    const isTurned = picture.at === at;
    picture.at = at;
    const step = run.steps[at - 1];
    const draw = (blocks, isDone) => paint(canvas, run, { ...state, blocks }, isDone ? step : null, player.view, scene);
    if (isTurned && picture.moving) return;
    cancelAnimationFrame(picture.moving);
    picture.moving = 0;
    if (!before || !Solid.ready || isStill()) draw(state.blocks, true);
    else move(picture, before.blocks, state, draw);
  }

  function move(picture, before, state, draw) {
    const began = performance.now();
    const isNew = (block) => block === state.fresh && !before.includes(block);
    const moves = Solid.between(before, state.blocks, 0).some((block, i) => block !== state.blocks[i]);
    const whole = DROP_MS + (moves ? FALL_MS : 0);
    const tick = () => {
      const past = performance.now() - began;
      if (past >= whole || !picture.canvas.isConnected) {
        picture.moving = 0;
        draw(state.blocks, true);
        return;
      }
      const dropped = Math.min(1, past / DROP_MS), fallen = Math.max(0, past - DROP_MS) / FALL_MS;
      const lift = DROP_M * (1 - dropped) ** 2;
      const blocks = Solid.between(before, state.blocks, fallen ** 2)
        .map((block, i) => (isNew(state.blocks[i])
          ? { ...block, position: [block.position[0], block.position[1], block.position[2] + lift] } : block));
      draw(blocks, false);
      picture.moving = requestAnimationFrame(tick);
    };
    tick();
  }

  function paint(canvas, run, state, step, view, scene) {
    const tried = step && scene ? Overlay.block(scene, step) : null;
    const isLarge = canvas.clientWidth >= BADGES_FROM_PX;
    const numbers = scene && Overlay.hasNumbers ? state.blocks.map((block) => Overlay.number(scene, block)) : [];
    const badges = isLarge ? numbers : numbers.map((number, i) => (state.blocks[i] === state.fresh ? number : ""));
    Solid.draw(canvas, state.blocks, {
      ...state, view, framed: run.framed, ...colors(), grid: rgb("--grid-rgb"), badges, tried,
      triedBadge: tried && Overlay.hasNumbers ? String(step.number) : "",
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

  /** Drag, touch or the arrow keys turn all drawings of a player; a double click turns back. */
  function turnable(canvas, player) {
    let from = null;
    canvas.addEventListener("pointerdown", (event) => {
      from = [event.clientX, event.clientY, ...player.view];
      canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener("pointermove", (event) => {
      if (!from) return;
      const [x, y, azimuth, elevation] = from;
      player.look(azimuth - (event.clientX - x) * DEGREES_PER_PX, elevation + (event.clientY - y) * DEGREES_PER_PX);
    });
    for (const name of ["pointerup", "pointercancel"]) {
      canvas.addEventListener(name, () => {
        from = null;
      });
    }
    canvas.addEventListener("dblclick", () => player.look(...HOME));
    canvas.addEventListener("keydown", (event) => {
      const by = { ArrowLeft: [1, 0], ArrowRight: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
      if (!by && event.key !== "Home") return;
      event.preventDefault();
      event.stopPropagation();
      if (by) player.look(...player.view.map((angle, i) => angle + DEGREES_PER_KEY * by[i]));
      else player.look(...HOME);
    });
  }

  /** A canvas that is drawn once it is in the page; see `draw`. With a player it turns with the others. */
  function picture(label, blocks, options, kind = "goal", player = null) {
    const canvas = el("canvas", { class: `picture ${kind}`, role: "img", "aria-label": label });
    canvas.drawing = [blocks, options];
    if (player) {
      canvas.classList.add("turns");
      turnable(canvas, player);
      player.listeners.push(() => {
        canvas.drawing[1] = { ...options, view: player.view };
        if (canvas.clientWidth) once(canvas);
      });
    }
    return canvas;
  }

  function once(canvas) {
    const [blocks, options] = canvas.drawing;
    const badges = canvas.clientWidth >= BADGES_FROM_PX || !options.badges ? options.badges : [];
    Solid.draw(canvas, blocks, { view: HOME, ...options, badges, grid: options.grid ? rgb("--grid-rgb") : null, ...colors() });
  }

  const inSight = new IntersectionObserver((seen) => {
    for (const { target, isIntersecting } of seen) if (isIntersecting) once(target);
  }, { rootMargin: "400px" });

  /** Draw every picture of a place when it comes into sight, again after a change of size or colors;
   *  at once where it goes on paper. */
  function draw(place, isPrinted = false) {
    for (const canvas of place?.querySelectorAll("canvas.picture:not(.turns)") || []) {
      inSight.unobserve(canvas);
      if (isPrinted) once(canvas);
      else inSight.observe(canvas);
    }
  }

  return { Player, wrongSteps, controls, panel, picture, draw, HOME };
})();
