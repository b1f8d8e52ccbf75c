/** Text as one word of a POSIX shell. */
export function shell(text: string): string {
  return /^[A-Za-z0-9_./:=,@%+-]+$/.test(text) ? text : `'${text.replaceAll("'", `'\\''`)}'`;
}

/** Text as a string of JavaScript and of Python, whose escapes are the same for what JSON escapes. */
export function literal(text: string): string {
  return JSON.stringify(text).replace(/[\u007f-\uffff]/g, (c) => `\\u${c.charCodeAt(0).toString(16).padStart(4, "0")}`);
}

/** Text as an attribute of HTML. */
export function attribute(text: string): string {
  const entities: Record<string, string> = { "&": "&amp;", '"': "&quot;", "<": "&lt;", ">": "&gt;" };
  return `"${text.replace(/[&"<>]/g, (c) => entities[c] ?? c)}"`;
}

/** Text between the brackets of a link in Markdown. */
export function markdown(text: string): string {
  return text.replace(/[\\`*_{}[\]<>()#!|]/g, (c) => `\\${c}`);
}
