/* What a model said, what was read in it, and the facts of the call. */
"use strict";

const Reply = (() => {
  /** Fields that say how a reply was read, not what was read in it. */
  const HOW_READ = new Set(["rule", "parser", "version", "problem", "dropped", "file_plan", "letters", "move", "plan"]);

  function card(reply, parse, title = "Reply") {
    if (!reply) return null;
    return el("section", { class: "card" }, el("h2", {}, title), parsed(parse),
      reply.reasoning ? folded("Reasoning", text(reply.reasoning)) : null,
      text(reply.text || "(empty)"));
  }

  /** A text of a model, as Markdown with the raw text at hand. */
  function text(said) {
    const made = Markdown.render(said);
    const raw = () => el("pre", { class: "text reply", tabindex: 0 }, said);
    if (made === null) return raw();
    return el("div", { class: "spoken" }, el("div", { class: "markdown" }, made), folded("Raw text", raw()));
  }

  /** What was read: a plan, letters or a move as it is, what other tracks keep by its names. */
  function readIn(parse) {
    const plain = [parse.plan, parse.letters, parse.move].find((one) => one !== null && one !== undefined);
    if (plain !== undefined) return Array.isArray(plain) ? plain.join(" → ") : String(plain);
    return Object.entries(parse).filter(([name, value]) => !HOW_READ.has(name) && value !== null && value !== undefined)
      .map(([name, value]) => `${Words.named(name)} ${typeof value === "string" ? value : JSON.stringify(value)}`).join(", ");
  }

  function parsed(parse) {
    if (!parse) return null;
    const values = readIn(parse);
    const rule = parse.rule ? `read by the rule ${parse.rule}` : values ? "" : "nothing could be read";
    const dropped = parse.dropped && parse.dropped.length ? `; dropped, no such candidate: ${parse.dropped.join(", ")}` : "";
    return el("p", { class: "parsed" }, values ? el("b", { class: "number plan" }, values) : null,
      el("span", { class: "muted" }, ` ${rule}${dropped}${parse.parser ? `, parser ${parse.parser}` : ""}`));
  }

  function folded(title, ...children) {
    return el("details", {}, el("summary", {}, title), children);
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

  return { card, text, parsed, folded, facts };
})();
