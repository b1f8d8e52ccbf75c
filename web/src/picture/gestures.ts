import { fit, pan, turn, zoom } from "../camera/move";
import { endStep } from "../state/history";
import { hold, touch } from "./live";

const DEGREES_PER_PX = 0.4;
const KEY_DEGREES = 5;
const KEY_ZOOM = 1.15;

/** Turns, moves and zooms the picture by mouse, pen, touch and keys. Returns what takes all of it off again. */
export function gestures(stage: HTMLElement): () => void {
  const off = new AbortController();
  const on = { signal: off.signal };
  pointers(stage, on);
  stage.addEventListener("wheel", (event) => wheel(event), { ...on, passive: false });
  stage.addEventListener(
    "dblclick",
    () => {
      endStep();
      fit();
    },
    on,
  );
  stage.addEventListener("keydown", (event) => keys(event), on);
  stage.addEventListener("contextmenu", (event) => event.shiftKey && event.preventDefault(), on);
  return () => off.abort();
}

interface Point {
  x: number;
  y: number;
}

function pointers(stage: HTMLElement, on: AddEventListenerOptions): void {
  const down = new Map<number, Point>();
  stage.addEventListener(
    "pointerdown",
    (event) => {
      if (event.button > 1) return;
      stage.setPointerCapture(event.pointerId);
      stage.focus({ preventScroll: true });
      down.set(event.pointerId, { x: event.clientX, y: event.clientY });
      if (down.size === 1) endStep();
    },
    on,
  );
  stage.addEventListener(
    "pointermove",
    (event) => {
      const before = down.get(event.pointerId);
      if (!before) return;
      const now = { x: event.clientX, y: event.clientY };
      const others = [...down].filter(([id]) => id !== event.pointerId).map(([, point]) => point);
      if (now.x === before.x && now.y === before.y) return;
      hold(true);
      down.set(event.pointerId, now);
      if (others[0]) pinch(before, now, others[0], stage);
      else drag(now.x - before.x, now.y - before.y, event.shiftKey || event.buttons === 4, stage);
    },
    on,
  );
  const end = (event: PointerEvent) => {
    if (!down.delete(event.pointerId) || down.size > 0) return;
    hold(false);
    endStep();
  };
  stage.addEventListener("pointerup", end, on);
  stage.addEventListener("pointercancel", end, on);
  stage.addEventListener("lostpointercapture", end, on);
}

function drag(dx: number, dy: number, sideways: boolean, stage: HTMLElement): void {
  if (sideways) void pan(-dx / stage.clientHeight, dy / stage.clientHeight);
  else turn(-dx * DEGREES_PER_PX, dy * DEGREES_PER_PX);
}

function pinch(before: Point, now: Point, other: Point, stage: HTMLElement): void {
  const far = (p: Point) => Math.hypot(p.x - other.x, p.y - other.y) || 1;
  const factor = far(now) / far(before);
  if (Math.abs(factor - 1) > 0.002) void zoom(factor);
  drag((now.x - before.x) / 2, (now.y - before.y) / 2, true, stage);
}

function wheel(event: WheelEvent): void {
  event.preventDefault();
  const lines = event.deltaMode === WheelEvent.DOM_DELTA_LINE ? 20 : 1;
  void zoom(Math.exp(-Math.max(-200, Math.min(200, event.deltaY * lines)) * 0.0016));
}

function keys(event: KeyboardEvent): void {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  const step = event.shiftKey ? KEY_DEGREES * 3 : KEY_DEGREES;
  const actions: Record<string, () => void> = {
    // As a drag into the same direction.
    "ArrowLeft": () => turn(step, 0),
    "ArrowRight": () => turn(-step, 0),
    "ArrowUp": () => turn(0, -step),
    "ArrowDown": () => turn(0, step),
    "+": () => void zoom(KEY_ZOOM),
    "=": () => void zoom(KEY_ZOOM),
    "-": () => void zoom(1 / KEY_ZOOM),
    "0": fit,
    "Home": fit,
  };
  const action = actions[event.key];
  if (!action) return;
  event.preventDefault();
  touch();
  action();
}
