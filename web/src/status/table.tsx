import type { ComponentChildren } from "preact";
import { useEffect, useRef } from "preact/hooks";
import { strings } from "../strings";

const words = strings.status.explained;

interface Props {
  name: string;
  title: string;
  columns: string[];
  rows: ComponentChildren[][];
  /** Columns of text; all others are numbers and stand to the right. */
  text?: number[];
}

/** A table with its heading. Columns that are empty in all rows are left out. */
export function Table({ name, title, columns, rows, text = [0] }: Props) {
  if (rows.length === 0) return null;
  const used = columns.map((_, i) => i).filter((i) => rows.some((row) => row[i] !== null && row[i] !== undefined));
  const kind = (i: number) => (text.includes(i) ? "" : "number");
  return (
    <section>
      <h2 id={`${name}-title`}>{title}</h2>
      <div class="scroller" tabIndex={0} role="region" aria-labelledby={`${name}-title`}>
        <table data-test={name} aria-labelledby={`${name}-title`}>
          <thead>
            <tr>
              {used.map((i) => (
                <th key={i} scope="col" class={kind(i)}>
                  {columns[i]}
                </th>
              ))}
            </tr>
          </thead>
          <tbody>
            {rows.map((row, r) => (
              <tr key={r}>
                {used.map((i) => (
                  <td key={i} class={kind(i)}>
                    {explained(row[i])}
                  </td>
                ))}
              </tr>
            ))}
          </tbody>
        </table>
      </div>
    </section>
  );
}

/** A word with its explanation, if it has one. */
function explained(cell: ComponentChildren): ComponentChildren {
  const help = typeof cell === "string" && Object.hasOwn(words, cell) ? words[cell] : undefined;
  return help ? (
    <span class="explained" title={help}>
      {cell}
    </span>
  ) : (
    cell
  );
}

/** A share as a bar with its figure. Near a limit it is red. */
export function Share({ of, all, isLimit }: { of: number; all: number; isLimit?: boolean }) {
  const bar = useRef<HTMLSpanElement>(null);
  const share = all > 0 ? Math.min(1, of / all) : 0;
  useEffect(() => {
    if (bar.current) bar.current.style.width = `${share * 100}%`;
  });
  return (
    <span class={isLimit && share > 0.9 ? "share is-high" : "share"}>
      <span class="share-bar">
        <span ref={bar} />
      </span>
      <span class="share-text">{(share * 100).toFixed(share < 0.1 ? 1 : 0)} %</span>
    </span>
  );
}
