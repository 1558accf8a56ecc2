// Torque constants over time: points with two standard deviations, nominal value, fitted trend.
const SVG = "http://www.w3.org/2000/svg";
const WIDTH = 320, HEIGHT = 150, LEFT = 52, RIGHT = 8, TOP = 8, BOTTOM = 22;

function shape(name, attributes, text) {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  if (text !== undefined) made.textContent = text;
  return made;
}

function scale(low, high, from, to) {
  return value => from + (value - low) / (high - low || 1) * (to - from);
}

function mean(points) {
  let weight = 0, sum = 0;
  for (const p of points) { const w = 1 / (p.std * p.std); weight += w; sum += w * p.value; }
  return sum / weight;
}

// points: [{at: ms, value, std}], oldest first
export function constantChart(points, nominal, trend) {
  const low = Math.min(...points.map(p => p.value - 2.5 * p.std));
  const high = Math.max(...points.map(p => p.value + 2.5 * p.std));
  const first = points[0].at, last = points.at(-1).at;
  const x = first === last ? () => (LEFT + WIDTH - RIGHT) / 2 : scale(first, last, LEFT + 8, WIDTH - RIGHT - 8);
  const y = scale(low, high, HEIGHT - BOTTOM, TOP);
  const chart = shape("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img", width: "100%" });
  for (const value of [low, (low + high) / 2, high]) {
    chart.append(shape("line", { class: "axis", x1: LEFT, x2: WIDTH - RIGHT, y1: y(value), y2: y(value) }));
    chart.append(shape("text", { x: LEFT - 6, y: y(value) + 4, "text-anchor": "end" }, value.toFixed(4)));
  }
  if (nominal !== null && nominal > low && nominal < high) {
    chart.append(shape("line", { class: "nominal", x1: LEFT, x2: WIDTH - RIGHT, y1: y(nominal), y2: y(nominal) }));
  }
  for (const p of points) {
    chart.append(shape("line", { class: "bar", x1: x(p.at), x2: x(p.at), y1: y(p.value - 2 * p.std), y2: y(p.value + 2 * p.std) }));
    const dot = shape("circle", { class: "point", cx: x(p.at), cy: y(p.value), r: 2.6 });
    dot.append(shape("title", {}, `${new Date(p.at).toLocaleString()}: ${p.value.toPrecision(5)} ± ${p.std.toPrecision(2)} N·m/A`));
    chart.append(dot);
  }
  if (trend && trend.percent_per_year !== null && last > first) {
    const centre = mean(points), middle = points.reduce((s, p) => s + p.at, 0) / points.length;
    const slope = Math.abs(centre) * trend.percent_per_year / 100 / (365.25 * 864e5);
    const at = t => y(centre + slope * (t - middle));
    chart.append(shape("line", { class: "trend", x1: x(first), x2: x(last), y1: at(first), y2: at(last) }));
  }
  const day = t => new Date(t).toLocaleDateString("en-GB", { day: "numeric", month: "short" });
  chart.append(shape("text", { x: LEFT, y: HEIGHT - 6 }, day(first)));
  if (last > first) chart.append(shape("text", { x: WIDTH - RIGHT, y: HEIGHT - 6, "text-anchor": "end" }, day(last)));
  return chart;
}
