import { useEffect, useRef } from "preact/hooks";
import { lineOf } from "../copy/lines";
import { finished } from "../picture/live";
import type { Shown } from "../picture/loop";
import { capabilities } from "../state/mesh";
import { bytes, strings } from "../strings";
import { Row } from "./report";

const words = strings.explain;

interface Stage {
  name: string;
  ms: number;
  note: string;
}

/** Reads Server-Timing. */
export function stagesOf(header: string | null): Stage[] {
  return (header ?? "").split(",").flatMap((part) => {
    const [name, ...parameters] = part.trim().split(";");
    const get = (key: string) =>
      parameters
        .find((p) => p.trim().startsWith(`${key}=`))
        ?.trim()
        .slice(key.length + 1);
    const ms = Number(get("dur"));
    return name && Number.isFinite(ms) ? [{ name, ms, note: (get("desc") ?? "").replaceAll('"', "") }] : [];
  });
}

/** What drawing the picture took, and by which means. */
export function ExplainPanel() {
  const current = finished.value;
  if (!current) return <p class="quiet">{words.none}</p>;
  const get = (name: string) => current.headers.get(name);
  const rows: [string, string | null][] = [
    [words.backend, get("x-render-backend")],
    [words.chosen, get("x-chosen")],
    [words.error, get("x-expected-error") && words.errorUnit(get("x-expected-error")!)],
    [words.warnings, get("x-warnings")],
    [words.cache, get("x-cache")],
    [words.request, get("x-request-id")],
  ];
  const { width, height } = current.picture.size;
  return (
    <div class="explain" data-test="explain">
      <dl>
        <Row name={words.size}>
          {width} × {height}, {bytes(current.bytes.size)}
        </Row>
        <Row name={words.total}>{words.ms(current.tookMs)}</Row>
        {rows.map(
          ([name, value]) =>
            value && (
              <Row name={name} key={name}>
                {value}
              </Row>
            ),
        )}
      </dl>
      <Stages shown={current} />
      <p class="quiet">{words.skips}</p>
      <pre tabIndex={0}>{explainLine(current)}</pre>
    </div>
  );
}

function explainLine({ picture }: Shown): string {
  const limit = capabilities.value?.limits?.image_px ?? 4096;
  return `${lineOf("command", picture, { keyed: false, limit })} --explain`;
}

function Stages({ shown }: { shown: Shown }) {
  const stages = stagesOf(shown.headers.get("server-timing"));
  if (stages.length === 0) return <p class="quiet">{words.cached}</p>;
  const most = Math.max(...stages.map(({ ms }) => ms), 0.001);
  return (
    <>
      <h2>{words.stages}</h2>
      <ul class="stages">
        {stages.map((stage) => (
          <StageBar key={stage.name} stage={stage} share={stage.ms / most} />
        ))}
      </ul>
    </>
  );
}

function StageBar({ stage, share }: { stage: Stage; share: number }) {
  const bar = useRef<HTMLSpanElement>(null);
  useEffect(() => {
    if (bar.current) bar.current.style.width = `${Math.max(0.5, share * 100)}%`;
  });
  return (
    <li>
      <span class="stage-name">
        {stage.name}
        {stage.note && <small> {stage.note}</small>}
      </span>
      <span class="stage-bar">
        <span ref={bar} />
      </span>
      <span class="stage-ms">{words.ms(stage.ms)}</span>
    </li>
  );
}
