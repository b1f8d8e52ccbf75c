/** A colour as the server takes it: names and notations of CSS become `#rrggbb`; all else stays as it is. */
export function digitsOf(colour: string): string {
  if (/^([0-9a-f]{3,4}|[0-9a-f]{6}|[0-9a-f]{8})$/i.test(colour)) return `#${colour}`;
  if (/^(#.*|transparent|current.*|)$/i.test(colour) || !CSS.supports("color", colour)) return colour;
  const context = document.createElement("canvas").getContext("2d");
  if (!context) return colour;
  context.fillStyle = colour;
  const made = String(context.fillStyle);
  const [r, g, b, a] = (/^rgba\((.+)\)$/.exec(made)?.[1] ?? "").split(",").map(Number);
  if (a === undefined) return made.startsWith("#") ? made : colour;
  return `#${[r ?? 0, g ?? 0, b ?? 0, Math.round(a * 255)].map((n) => n.toString(16).padStart(2, "0")).join("")}`;
}

/** A background: one colour, or two that run into each other. */
export function backgroundOf(text: string): string {
  return text
    .split("..")
    .map((part) => digitsOf(part.trim()))
    .join("..");
}
