// The lab at a glance. Everything comes from /v1; nothing is inserted as markup.
import { constantChart } from "/web/chart.js";

const $ = id => document.getElementById(id);
let token = new URLSearchParams(location.hash.slice(1)).get("token") || sessionStorage.getItem("token") || "";
if (location.hash) history.replaceState(null, "", location.pathname);  // keep it out of the address bar

function element(name, attributes = {}, ...children) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (key.startsWith("on")) made.addEventListener(key.slice(2), value); else made.setAttribute(key, value);
  }
  made.append(...children.map(child => child ?? "–"));
  return made;
}

async function get(path, kind = "json") {
  const answer = await fetch(path, { headers: { Authorization: `Bearer ${token}` } });
  if (answer.ok) return kind === "blob" ? answer.blob() : answer.json();
  const problem = await answer.json().catch(() => ({ detail: answer.statusText }));
  throw Object.assign(new Error(problem.detail), { status: answer.status });
}

function table(headings, rows, empty) {
  if (!rows.length) return element("p", { class: "quiet" }, empty);
  const head = element("tr", {}, ...headings.map(text => element("th", {}, text)));
  const body = rows.map(cells => element("tr", {}, ...cells.map(cell => cell instanceof Node && cell.nodeName === "TD" ? cell : element("td", {}, cell))));
  return element("table", {}, element("thead", {}, head), element("tbody", {}, ...body));
}

const number = text => element("td", { class: "number" }, text);
const mark = (text, kind) => element("span", { class: `mark ${kind}` }, text);
const when = text => new Date(text).toLocaleString("en-GB", { day: "numeric", month: "short", year: "numeric", hour: "2-digit", minute: "2-digit" });
const KIND = { accepted: "good", finished: "good", recording: "warn", aborted: "bad", done: "good", consistent: "good", explained: "good", proposed: "warn", running: "warn", queued: "warn",
  partly_explained: "warn", interrupted: "bad", failed: "bad", unexplained: "bad" };
const state = text => mark(text.replaceAll("_", " "), KIND[text] || "quiet");
const simulated = flag => flag ? mark("simulated", "warn") : "";

async function open(path, label) {  // with the token, which a plain link would not carry
  const blob = await get(path, "blob");
  const link = element("a", { href: URL.createObjectURL(blob), target: "_blank", rel: "noopener" });
  if (label) link.download = label;
  link.click();
}
const opener = (text, path, label) => element("button", { class: "link", onclick: () => open(path, label).catch(fail) }, text);

const significant = (value, std) => std ? value.toFixed(Math.max(0, Math.min(9, 1 - Math.floor(Math.log10(std))))) : value.toPrecision(4);

function show(id, ...children) { $(id).replaceChildren(...children); }

function showRobots(robots) {
  show("robots", table(["serial", "robot", "", "unattended motion", "lease", "description"], robots.map(robot => [
    robot.serial, robot.name, simulated(robot.simulated), robot.unattended ? "cleared" : "not cleared",
    robot.lease ? `${robot.lease.owner} until ${when(robot.lease.expires_at)}` : "free", element("code", {}, robot.model_hash),
  ]), "No robot is registered yet: POST /v1/robots."));
}

async function showConstants(robots) {
  const parts = [];
  for (const robot of robots) {
    const [history, calibration] = await Promise.all([get(`/v1/robots/${robot.serial}/torque-constants`), get(`/v1/robots/${robot.serial}/calibration`)]);
    if (!history.points.length) continue;
    const inForce = history.points.find(point => calibration && point.estimate_id === calibration.estimate_id);
    parts.push(element("h3", {}, `${robot.serial} `, calibration ? state("accepted") : mark("nothing accepted", "quiet"), " ", simulated(robot.simulated)));
    if (calibration) parts.push(element("p", { class: "quiet" }, `In force since ${when(calibration.history.at(-1).at)}, by ${calibration.history.at(-1).by}.`));
    parts.push(element("div", { class: "charts" }, ...joints(history).map(joint => constantFigure(joint, history, inForce))));
  }
  show("constants", ...(parts.length ? parts : [element("p", { class: "quiet" }, "No estimate yet.")]));
}

const joints = history => [...new Set(history.points.flatMap(point => point.torque_constants.map(k => k.joint)))];

function constantFigure(joint, history, inForce) {
  const find = point => point.torque_constants.find(k => k.joint === joint && k.value !== null && k.std);
  const points = history.points.filter(find).map(point => ({ at: Date.parse(point.at), value: find(point).value, std: find(point).std }));
  const figure = element("figure", { style: "margin:0" }, element("strong", {}, joint));
  if (!points.length) { figure.append(element("p", { class: "quiet" }, "not identified")); return figure; }
  const trend = history.trends.find(t => t.joint === joint);
  const now = inForce && find(inForce);
  if (now) figure.append(` ${significant(now.value, now.std)} ± ${now.std.toPrecision(2)} N·m/A in force`);
  const nominal = find(history.points.findLast(find)).nominal;
  figure.append(constantChart(points, nominal, trend));
  if (trend) figure.append(element("p", { class: trend.is_alarm ? "bad" : "quiet", style: "margin:0" }, trend.sentence));
  return figure;
}

function showDiagnoses(page) {
  show("diagnoses", table(["made", "robot", "verdict", "findings", ""], page.items.map(item => [
    when(item.created_at), item.robot_serial, item.verdict ? state(item.verdict) : state(item.job.state),
    item.findings.length ? element("div", {}, ...item.findings.map(text => element("div", {}, text))) : "–",
    element("td", {}, simulated(item.simulated), " ", item.verdict ? opener("report", `/v1/diagnoses/${item.id}/report`) : ""),
  ]), "No diagnosis yet."));
}

function showCalibrations(page) {
  show("calibrations", table(["proposed", "robot", "state", "last change", ""], page.items.map(item => {
    const last = item.history.at(-1);
    return [when(item.created_at), item.robot_serial, state(item.state), `${last.event} by ${last.by}${last.reason ? `: ${last.reason}` : ""}`,
      element("td", {}, simulated(item.simulated), " ", opener("estimate", `/v1/estimates/${item.estimate_id}/estimate.json`, "estimate.json"))];
  }), "No calibration yet."));
}

function showNights(page) {
  show("nights", table(["night", "robot", "outcome", ""], page.items.map(item =>
    [when(item.created_at), item.robot_serial, state(item.outcome), item.sentence]), "No night yet."));
}

function showRecordings(page) {
  show("recordings", table(["stored", "robot", "recording", "kind", "length", ""], page.items.map(item => [
    when(item.created_at), item.robot_serial, opener(item.label, `/v1/recordings/${item.id}/file`, item.label), item.kind,
    number(`${item.facts.duration_s.toFixed(0)} s`), simulated(item.simulated),
  ]), "No recording yet."));
}

async function abort(id) {
  const answer = await fetch(`/v1/runs/${id}/abort`, { method: "POST", headers: { Authorization: `Bearer ${token}` } });
  if (!answer.ok) throw new Error((await answer.json()).detail);
}

function showRuns(page) {
  show("runs", table(["asked", "robot", "state", "length", "", ""], page.items.map(item => [
    when(item.created_at), item.robot_serial, state(item.state), number(`${item.preview.duration_s.toFixed(0)} s`),
    item.state === "recording" && item.progress
      ? element("span", {}, element("progress", { value: item.progress.cycle, max: item.progress.cycles || 1 }), ` ${item.progress.remaining_s.toFixed(0)} s left `, element("button", { onclick: () => abort(item.id).catch(fail) }, "Abort"))
      : item.error ? element("span", { class: "bad" }, `${item.error.cause}; ${item.error.remedy}.`) : "",
    simulated(item.simulated),
  ]), "No run yet."));
}

function showJobs(page) {
  show("jobs", table(["asked", "job", "state", ""], page.items.map(item => [
    when(item.created_at), item.kind, state(item.state),
    item.state === "running" ? element("span", {}, element("progress", { value: item.progress, max: 1 }), ` ${item.stage}`)
      : item.error ? element("span", { class: "bad" }, `${item.error.cause}; ${item.error.remedy}.`) : "",
  ]), "No job yet."));
}

async function refresh() {
  const robots = await get("/v1/robots");
  showRobots(robots);
  const lists = { diagnoses: showDiagnoses, calibrations: showCalibrations, nights: showNights, recordings: showRecordings, runs: showRuns, jobs: showJobs };
  await Promise.all([showConstants(robots), ...Object.entries(lists).map(async ([name, draw]) => draw(await get(`/v1/${name}?limit=8`)))]);
  const health = await get("/v1/health");
  $("status").textContent = `${health.status === "ok" ? "running" : "failing"}, version ${health.version}, ${(health.disk_free_mb / 1000).toFixed(0)} GB free`;
}

function fail(error) {
  $("status").textContent = error.message;
  if (error.status === 401) enter(false);
}

function enter(known) {
  $("login").hidden = known;
  $("leave").hidden = !known;
  for (const part of document.querySelectorAll("[data-part]")) part.hidden = !known;
  if (!known) $("status").textContent = "A token is needed.";
}

async function follow() {  // an EventSource cannot carry the token
  let after = 0, waiting = false;
  const soon = () => { if (!waiting) { waiting = true; setTimeout(() => { waiting = false; refresh().catch(fail); }, 300); } };
  for (;;) {
    try {
      const answer = await fetch(`/v1/events?after=${after}`, { headers: { Authorization: `Bearer ${token}` } });
      if (answer.status === 401) return;
      const reader = answer.body.pipeThrough(new TextDecoderStream()).getReader();
      for (let rest = ""; ;) {
        const { value, done } = await reader.read();
        if (done) break;
        const blocks = (rest + value).split("\n\n");
        rest = blocks.pop();
        for (const block of blocks) { const found = block.match(/^id: (\d+)/m); if (found) { after = Number(found[1]); soon(); } }
      }
    } catch { $("status").textContent = "The server does not answer; trying again…"; }
    await new Promise(resolve => setTimeout(resolve, 2000));
  }
}

async function begin() {
  if (!token) { enter(false); return; }
  try { await refresh(); } catch (error) { fail(error); if (error.status === 401) { token = ""; sessionStorage.removeItem("token"); } return; }
  sessionStorage.setItem("token", token);
  enter(true);
  follow();
}

$("token-form").addEventListener("submit", event => { event.preventDefault(); token = $("token").value.trim(); $("token").value = ""; begin(); });
$("leave").addEventListener("click", () => { sessionStorage.removeItem("token"); location.reload(); });
begin();
