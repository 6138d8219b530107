/* One sample, whole: scene, assembly or answer, reply, prompt, and the same of another model. */
"use strict";

const Detail = (() => {
  let player = null;
  let shown = 0;

  /** Show sample `row`, beside it sample `other` of the same item where one is given. */
  async function show(place, row, other, setting) {
    const turn = ++shown;
    player?.stop();
    const samples = [row, other].filter((n) => n >= 0).map(Data.sample);
    try {
      const loaded = await Promise.all(samples.map(async (sample) => ({
        ...sample, setting, record: await Data.entry("records", sample.row),
      })));
      const sample = loaded[0];
      const scene = Data.index.starts.scenes.length ? await Data.entry("scenes", sample.sceneNumber) : null;
      const question = sample.question >= 0 ? await Data.entry("questions", sample.question) : null;
      // A later choice may have been quicker.
      if (turn !== shown) return;
      place.replaceChildren(...build(loaded, scene, question));
      player?.tell();
      drawPictures(place);
    } catch (error) {
      if (turn === shown) place.replaceChildren(el("p", { class: "notice" }, error.message));
    }
  }

  function build(loaded, inFile, question) {
    const scene = inFile && asShown(inFile, loaded[0].record);
    const several = loaded.length > 1;
    const all = columns(loaded.map((sample) => [
      several ? heading(sample) : null, question ? Question.answer(sample) : null, ...texts(sample)]));
    if (question) {
      player = null;
      return [Question.about(question, loaded[0]), all];
    }
    return [assembly(loaded, scene, several), scene ? candidates(scene) : null, all].filter(Boolean);
  }

  /** The scene with its candidates in the order in which the samples' seed showed them. */
  function asShown(scene, { shown, pose }) {
    if (!shown) return scene;
    const isUpright = pose?.rotation === "free";
    const candidates = shown.order.map((n) => scene.candidates[n - 1])
      .map((one) => (isUpright ? { ...one, euler: [0, 0, 0] } : one));
    const number = (block) => (isUpright ? candidates.findIndex((one) => Words.block(one) === Words.block(block))
      : shown.order.indexOf(block.candidate)) + 1;
    return { ...scene, candidates,
      blocks: scene.blocks.map((block) => ({ ...block, candidate: number(block) })) };
  }

  /** Goal and what was built side by side, under one clock; the steps below. */
  function assembly(loaded, scene, several) {
    const runs = loaded.map((sample) => stepsOf(sample, scene));
    const longest = Math.max(...runs.map(({ steps }) => steps.length));
    const noun = loaded[0].record.turns ? "Turn" : "Step";
    player = new Stage.Player(longest + 1);
    const panels = loaded.map((sample, i) => (runs[i].steps.length ? Stage.panel(runs[i], player, noun) : null));
    const stages = panels.map((panel, i) => [
      several ? heading(loaded[i]) : null, verdict(loaded[i]), panel ? panel.said : nothing(loaded[i])]);
    const wide = Math.max(...runs.map(({ titles }) => titles.length)) > 1 ? " wide" : "";
    const built = panels.flatMap((panel, i) => [
      runs[i].titles.map((title, k) => el("figure", { class: "built" },
        el("figcaption", {}, captionOf(loaded[i], title, several, wide)), panel?.pictures[k]?.canvas)),
      several ? null : el("div", { class: "about-step" }, stages[i])]);
    return el("section", { class: "card" },
      scene ? null : el("p", { class: "notice" }, Data.index.no_scenes || "The data set has no such scene."),
      el("div", { class: `sides${several ? " two" : ""}${wide}` }, scene ? goal(scene, loaded[0]) : null,
        scene ? built : stages.map((parts) => el("div", {}, parts))),
      several && scene ? el("div", { class: "columns two" }, stages.map((parts) => el("div", {}, parts))) : null,
      longest ? Stage.controls(player, noun) : null,
      panels.map((panel, i) => panel && [several ? el("p", { class: "muted strip-of" }, loaded[i].model) : null, panel.strip]).flat());
  }

  function columns(contents) {
    return el("div", { class: contents.length > 1 ? "columns two" : "columns" },
      contents.map((children) => el("div", {}, children)));
  }

  const captionOf = ({ model }, title, several, wide) =>
    (several ? `${model}${wide && `: ${title.toLowerCase()}`}` : title);

  const heading = (sample) => el("h4", { class: "model-name" }, sample.model);

  function stepsOf(sample, scene) {
    const { record, setting } = sample;
    if (record.turns) return Steps.ofTurns(scene, setting, record.turns);
    if (record.pose) return Poses.of(scene, record);
    const score = headline(record.scores, setting);
    const plan = record.parse && score ? record.parse.plan : [];
    return Steps.ofPlan(scene, setting, plan, score);
  }

  const headline = (scores, setting) => scores.find((score) =>
    score.setting === setting && score.matcher === Data.index.matcher && score.placed) || null;

  function nothing(sample) {
    const { record } = sample;
    const problem = record.parse?.problem ? `: ${Words.named(record.parse.problem)}` : "";
    const why = record.error ? record.error.message
      : record.reply ? `Nothing could be read out of the reply${problem}.` : "There is no reply.";
    return el("p", { class: "notice" }, why);
  }

  /** Counts and metrics of a sample in one line. */
  function verdict(sample) {
    const score = sample.scores[sample.setting];
    const { record } = sample;
    const facts = [];
    if (sample.outcome !== "ok") facts.push(el("span", { class: "chip" }, Words.named(sample.outcome)));
    if (score) {
      for (const [name, value] of [["F1", Words.percent(score.f1)], ["TP", score.tp], ["FP", score.fp], ["FN", score.fn]]) {
        facts.push(el("span", { class: "fact" }, `${name} `, el("b", { class: "number" }, String(value))));
      }
      facts.push(el("span", { class: "fact muted" }, `Setting ${sample.setting}`));
    }
    for (const [name, value] of record.pose ? Poses.facts(record) : []) {
      facts.push(el("span", { class: "fact" }, `${name} `, el("b", { class: "number" }, value)));
    }
    if (record.ending) facts.push(el("span", { class: "fact muted" }, `Ended: ${Words.named(record.ending)}`));
    return el("p", { class: "facts" }, facts);
  }

  function goal(scene, sample) {
    const { levels, record: { shown } } = sample;
    const other = shown && shown.goal !== sample.scene
      ? (shown.goal ? `; shown was the goal of ${shown.goal}` : "; no goal was shown") : "";
    return el("figure", {}, el("figcaption", {}, "Goal ", el("span", { class: "muted" },
      `${Words.count(scene.blocks.length, "block")}, level${levels.length > 1 ? "s" : ""} ${levels.join(" and ")}${other}`)),
    picture("Goal", scene.blocks, { view: Stage.HOME, grid: true }, "goal"));
  }

  function candidates(scene) {
    const uses = new Map();
    for (const { candidate } of scene.blocks) uses.set(candidate, (uses.get(candidate) || 0) + 1);
    const cells = scene.candidates.map((candidate, i) => {
      const n = i + 1, times = uses.get(n), name = `${n}: ${Words.block(candidate)}`;
      const alone = [Solid.onTheFloor(candidate)];
      return el("li", { class: times ? "needed" : "", title: `${name}, turned ${candidate.euler.join(", ")} degrees` },
        el("span", { class: "cell-head number" }, el("span", {}, String(n)),
          times ? el("span", { class: "cell-uses" }, `×${times}`) : null),
        picture(`Candidate ${name}`, alone, { view: Stage.HOME, minDistance: 0 }, "cell"));
    });
    return el("section", { class: "card" }, el("h3", {}, "Candidates ",
      el("span", { class: "muted" }, "framed: needed by the goal, and how often")),
    el("ol", { class: "cells" }, cells));
  }

  /** A canvas that is drawn once it is in the page; see drawPictures. */
  function picture(label, blocks, options, kind) {
    const canvas = el("canvas", { class: `picture ${kind}`, role: "img", "aria-label": label });
    canvas.drawing = [blocks, options];
    return canvas;
  }

  /** Draw all canvases again, after a change of size or colors too. */
  function drawPictures(place) {
    for (const canvas of place.querySelectorAll("canvas.picture")) {
      const [blocks, options] = canvas.drawing;
      const grid = options.grid ? Stage.style("--grid") : null;
      Solid.draw(canvas, blocks, { ...options, grid, accent: Stage.accent() });
    }
  }

  function texts(sample) {
    const { record } = sample;
    if (record.turns) return [Turns.cards(record), facts(record)];
    return [replyCard(record.reply, record.parse), promptCard(record.prompt), facts(record)];
  }

  function replyCard(reply, parse) {
    if (!reply) return null;
    return el("section", { class: "card" }, el("h3", {}, "Reply"), parsed(parse),
      reply.reasoning ? folded("Reasoning", el("pre", { class: "text" }, reply.reasoning)) : null,
      el("pre", { class: "text reply" }, reply.text || "(empty)"));
  }

  function parsed(parse) {
    if (!parse) return null;
    const rule = parse.rule ? `read by the rule ${parse.rule}` : "nothing could be read";
    const read = [parse.plan, parse.letters, parse.move].find((one) => one !== null && one !== undefined);
    const values = Array.isArray(read) ? read.join(" → ") : String(read ?? "");
    const dropped = parse.dropped && parse.dropped.length ? `; dropped, no such candidate: ${parse.dropped.join(", ")}` : "";
    return el("p", { class: "parsed" }, values ? el("b", { class: "number plan" }, values) : null,
      el("span", { class: "muted" }, ` ${rule}${dropped}${parse.parser ? `, parser ${parse.parser}` : ""}`));
  }

  function folded(title, ...children) {
    return el("details", {}, el("summary", {}, title), children);
  }

  /** The prompt as it was sent, loaded when it is opened. */
  function promptCard(prompt) {
    if (!prompt) return null;
    const body = el("div", { class: "prompt" });
    const made = folded("Prompt as sent", body);
    made.addEventListener("toggle", async () => {
      if (!made.open || body.childNodes.length) return;
      const images = new Map((prompt.images || []).map((image) => [image.label, image]));
      if (prompt.n === null || prompt.n === undefined) {
        body.append(el("p", { class: "muted" }, `Template ${prompt.template}; the text was not kept.`));
        for (const image of images.values()) body.append(sent(image));
        return;
      }
      for (const message of await Data.entry("prompts", prompt.n)) {
        body.append(el("p", { class: "role" }, message.role));
        for (const part of message.parts) {
          if (typeof part === "string") body.append(el("pre", { class: "text" }, part));
          else body.append(sent(images.get(part.image) || { label: part.image }));
        }
      }
    });
    return el("section", { class: "card" }, made);
  }

  function sent(image) {
    const size = image.width_px ? `, ${image.width_px} × ${image.height_px} pixels` : "";
    if (!image.file) return el("p", { class: "muted" }, `[picture: ${image.label}${size}]`);
    return el("figure", {}, el("img", {
      src: image.file, alt: `Picture as sent: ${image.label}`, loading: "lazy",
      width: image.width_px, height: image.height_px,
    }), el("figcaption", { class: "muted" }, `${image.label}${size}`));
  }

  function facts(record) {
    const { reply, error } = record;
    const rows = [];
    const add = (name, value, unit = "") => {
      if (value !== null && value !== undefined && value !== "") rows.push([name, `${value}${unit}`]);
    };
    if (reply) {
      add("Finish", reply.finish);
      add("Tokens in", reply.usage?.prompt_tokens?.toLocaleString("en"));
      add("Tokens out", reply.usage?.completion_tokens?.toLocaleString("en"));
      add("Tokens reasoning", reply.usage?.reasoning_tokens?.toLocaleString("en"));
      add("Cost", reply.cost_usd === null ? "unknown" : `$${Number(reply.cost_usd).toFixed(4)}`);
      add("Latency", reply.attempts ? Number(reply.latency_s).toFixed(2) : null, " s");
      add("Requests", reply.attempts);
      add("From the cache", reply.cached ? "yes" : null);
      add("Answered by", reply.provider_model);
    }
    if (error) {
      add("Error", error.kind);
      add("Status", error.status);
      add("Message", error.message);
    }
    add("Template", record.prompt?.template);
    add("Written", record.time);
    return el("section", { class: "card" }, folded("Facts",
      el("dl", {}, rows.map(([name, value]) => [el("dt", {}, name), el("dd", { class: "number" }, value)]))));
  }

  return {
    show, picture, drawPictures, promptCard, parsed, folded,
    get player() {
      return player;
    },
  };
})();
