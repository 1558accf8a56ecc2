// Shows /v1/openapi.json without any library.
const schema = await (await fetch("/v1/openapi.json")).json();

function element(name, attributes = {}, ...children) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.append(...children);
  return made;
}

const resolve = part => part?.$ref ? schema.components.schemas[part.$ref.split("/").at(-1)] : part;

function example(part, depth = 0) {  // a value that shows the form
  const found = resolve(part) ?? {};
  if (found.examples) return found.examples[0];
  if (found.default !== undefined) return found.default;
  if (found.const !== undefined) return found.const;
  if (found.enum) return found.enum[0];
  if (found.anyOf) return example(found.anyOf[0], depth);
  if (found.type === "array") return depth > 4 ? [] : [example(found.items, depth + 1)];
  if (found.type === "object" || found.properties) {
    return depth > 4 ? {} : Object.fromEntries(Object.entries(found.properties ?? {}).map(([key, value]) => [key, example(value, depth + 1)]));
  }
  return { string: found.format === "date-time" ? "2026-01-31T02:00:00Z" : "text", integer: 1, number: 0.5, boolean: false }[found.type] ?? null;
}

function type(part) {
  const found = resolve(part) ?? {};
  if (found.anyOf) return found.anyOf.map(type).join(" or ");
  return found.enum ? found.enum.join(" | ") : found.type === "array" ? `list of ${type(found.items)}` : found.type ?? "any";
}

function fields(title, rows) {
  if (!rows.length) return [];
  const body = rows.map(([name, kind, text, needed]) => element("tr", {}, element("td", {}, element("code", {}, name), needed ? " *" : ""), element("td", { class: "quiet" }, kind), element("td", {}, text ?? "")));
  return [element("h3", {}, title), element("table", {}, element("tbody", {}, ...body))];
}

function body(operation) {
  const content = operation.requestBody?.content;
  if (!content) return [];
  const [kind, { schema: form }] = Object.entries(content)[0];
  const found = resolve(form);
  const rows = Object.entries(found.properties ?? {}).map(([name, part]) => [name, type(part), part.description, found.required?.includes(name)]);
  const shown = kind === "application/json" ? [element("pre", {}, JSON.stringify(example(form), null, 1))] : [];
  return [...fields(`Body (${kind})`, rows), ...shown];
}

function answers(operation) {
  return Object.entries(operation.responses).flatMap(([status, { description, content }]) => {
    const form = content?.["application/json"]?.schema;
    const line = element("p", {}, element("code", {}, status), ` ${description}`);
    return form ? [line, element("pre", {}, JSON.stringify(example(form), null, 1))] : [line];
  });
}

function show(path, method, operation) {
  const parameters = (operation.parameters ?? []).map(p => [p.name, `${p.in}, ${type(p.schema)}`, p.description, p.required]);
  const summary = element("summary", {}, element("span", { class: "method" }, method.toUpperCase()), element("code", {}, path), ` ${operation.description.split("\n")[0]}`);
  return element("details", { class: "operation" }, summary, ...fields("Parameters", parameters), ...body(operation), element("h3", {}, "Answers"), ...answers(operation));
}

document.getElementById("about").textContent = `version ${schema.info.version}`;
const groups = new Map();
for (const [path, item] of Object.entries(schema.paths)) {
  for (const [method, operation] of Object.entries(item)) {
    const tag = operation.tags?.[0] ?? "other";
    groups.set(tag, [...(groups.get(tag) ?? []), show(path, method, operation)]);
  }
}
const intro = element("section", { class: "wide" }, ...schema.info.description.split("\n\n").map(text => element("p", {}, text.replaceAll("**", "").replaceAll("`", ""))));
document.getElementById("operations").append(intro, ...[...groups].map(([tag, shown]) => element("section", { class: "wide" }, element("h2", {}, tag), ...shown)));
