import { useEffect, useRef } from "preact/hooks";
import { schema } from "../controls/controls";
import { sectionsOf } from "../controls/schema";
import { look } from "../state/history";
import { strings } from "../strings";

const words = strings.picture.topology;

/** What the colours of the style topology mean, over the picture's corner. */
export function Legend() {
  const { keys } = look.value;
  if (keys["style"] !== "topology" || keys["topology"] === null || !schema.value) return null;
  const fields = sectionsOf(schema.value).find(({ name }) => name === "topology")?.fields ?? [];
  const colours = fields
    .filter(({ kind, name }) => kind === "colour" && name in words)
    .map(({ key, name, default: standard }) => ({ name, colour: key in keys ? keys[key] : standard }))
    .filter((one): one is { name: keyof typeof words; colour: string } => typeof one.colour === "string");
  return (
    <ul class="legend" aria-label={strings.picture.legend} data-test="legend">
      {colours.map(({ name, colour }) => (
        <li key={name}>
          <Line colour={colour} /> {words[name]}
        </li>
      ))}
    </ul>
  );
}

function Line({ colour }: { colour: string }) {
  const line = useRef<HTMLSpanElement>(null);
  useEffect(() => {
    if (line.current) line.current.style.background = /^[0-9a-f]/i.test(colour) ? `#${colour}` : colour;
  });
  return <span class="legend-line" ref={line} />;
}
