import { signal, useSignalEffect } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { finished } from "../picture/live";
import { mesh } from "../state/mesh";
import { shownSize } from "../state/size";
import { strings } from "../strings";
import { besideFinished, besideShown, compare, divider, heat } from "./state";
import { type HeatFigures, paintHeat } from "./heat";

/** Figures of the heat picture; "other" if the pictures cannot be compared. */
export const figures = signal<HeatFigures | "other" | null>(null);

/** The other side's picture over the one of now, cut at the divider; or their difference. */
export function CompareLayer() {
  if (!compare.value) return null;
  return heat.value ? <Heat /> : <Sides />;
}

function Sides() {
  const image = useRef<HTMLImageElement>(null);
  const handle = useRef<HTMLDivElement>(null);
  const { width, height } = shownSize.value;
  const at = divider.value;
  // A kept look stands to the left, and a mesh that was chosen to the right of the one that was open before.
  const isRight = compare.value?.mesh !== null;
  useEffect(() => {
    if (image.current) {
      image.current.style.width = `${width}px`;
      image.current.style.height = `${height}px`;
      image.current.style.clipPath = isRight ? `inset(0 0 0 ${at * 100}%)` : `inset(0 ${(1 - at) * 100}% 0 0)`;
    }
    if (handle.current) handle.current.style.left = `calc(50% + ${(at - 0.5) * width}px)`;
  });
  return (
    <>
      {besideShown.value && (
        <img
          ref={image}
          class="shot beside"
          src={besideShown.value.url}
          alt={isRight ? strings.compare.right : strings.compare.left}
          draggable={false}
          data-test="beside"
        />
      )}
      <div
        ref={handle}
        class="divider"
        onPointerDown={(event) => drag(event, width)}
        onDblClick={(e) => {
          e.stopPropagation();
          divider.value = 0.5;
        }}
      >
        <input
          type="range"
          min="0"
          max="1"
          step="0.01"
          value={at}
          aria-label={strings.compare.divider}
          data-test="divider"
          onInput={(e) => (divider.value = Number(e.currentTarget.value))}
          onKeyDown={(e) => e.stopPropagation()}
        />
      </div>
    </>
  );
}

function drag(event: PointerEvent, width: number): void {
  event.stopPropagation();
  event.preventDefault();
  const handle = event.currentTarget as HTMLElement;
  const frame = handle.parentElement!.getBoundingClientRect();
  handle.setPointerCapture(event.pointerId);
  const left = frame.left + (frame.width - width) / 2;
  handle.onpointermove = (move) => (divider.value = Math.max(0, Math.min(1, (move.clientX - left) / width)));
  handle.onpointerup = () => (handle.onpointermove = null);
}

function Heat() {
  const canvas = useRef<HTMLCanvasElement>(null);
  const { width, height } = shownSize.value;
  useEffect(() => {
    if (!canvas.current) return;
    canvas.current.style.width = `${width}px`;
    canvas.current.style.height = `${height}px`;
  });
  useSignalEffect(() => {
    const [a, b] = [besideFinished.value, finished.value];
    if (!a || !b || !canvas.current) return;
    void paintHeat(canvas.current, a.bytes, b.bytes).then((found) => (figures.value = found ?? "other"));
  });
  return <canvas ref={canvas} class="shot heat" role="img" aria-label={strings.compare.heat} data-test="heat" />;
}

/** Names of the two sides, over the corners of the picture. */
export function SideNames() {
  const compared = compare.value;
  if (!compared || heat.value) return null;
  return (
    <>
      <span class="side-name is-left">
        <bdi>{compared.mesh ? strings.compare.before(mesh.value?.name ?? "") : strings.compare.kept}</bdi>
      </span>
      <span class="side-name is-right">
        <bdi>{compared.mesh ? strings.compare.after(compared.mesh.name) : strings.compare.now}</bdi>
      </span>
    </>
  );
}

/** What the heat picture says in figures. */
export function HeatText() {
  const found = figures.value;
  if (!compare.value || !heat.value || !found) return null;
  if (found === "other") return <span class="side-name is-left">{strings.compare.differing}</span>;
  const text =
    found.most === 0
      ? strings.compare.same
      : strings.compare.figures(found.rmse.toFixed(2), found.most, (found.share * 100).toFixed(2));
  return (
    <span class="side-name is-left" data-test="heat-figures">
      {text}
    </span>
  );
}
