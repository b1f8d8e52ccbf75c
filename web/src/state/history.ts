import { computed, signal } from "@preact/signals";
import { EMPTY, type Look } from "./look";

const LIMIT = 200;
const SAME_CHANGE_MS = 700;

/** The look that is shown. */
export const look = signal<Look>(EMPTY);

const past = signal<Look[]>([]);
const future = signal<Look[]>([]);
let last = { what: "", at: 0 };

export const canUndo = computed(() => past.value.length > 0);
export const canRedo = computed(() => future.value.length > 0);

/**
 * Changes the look. Changes of the same thing in quick succession, as by a slider, are one step of
 * the history.
 */
export function change(what: string, next: Look): void {
  const now = performance.now();
  const joins = what === last.what && now - last.at < SAME_CHANGE_MS && past.value.length > 0;
  if (!joins) past.value = [...past.value, look.value].slice(-LIMIT);
  last = { what, at: now };
  future.value = [];
  look.value = next;
}

/** Begins a new step, so that the next change does not join the last one. */
export function endStep(): void {
  last = { what: "", at: 0 };
}

/** Replaces the look and forgets the history: for a look that comes with an address. */
export function restart(next: Look): void {
  past.value = [];
  future.value = [];
  endStep();
  look.value = next;
}

export function undo(): void {
  const previous = past.value.at(-1);
  if (!previous) return;
  past.value = past.value.slice(0, -1);
  future.value = [...future.value, look.value];
  endStep();
  look.value = previous;
}

export function redo(): void {
  const next = future.value.at(-1);
  if (!next) return;
  future.value = future.value.slice(0, -1);
  past.value = [...past.value, look.value];
  endStep();
  look.value = next;
}
