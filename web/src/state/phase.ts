import { computed, signal } from "@preact/signals";
import type { Refusal } from "../api/client";

/** State of opening a mesh. */
export type Phase =
  | { kind: "empty" }
  | { kind: "sending"; name: string; share: number }
  | { kind: "refused"; name: string; detail: string; code: string; flag: string | null; choices: string[] }
  | { kind: "lost"; name: string; sha256: string }
  | { kind: "open" };

export const phase = signal<Phase>({ kind: "empty" });

/** State of the connection: a wait ends at `untilMs` of the page's clock. */
export type Connection = { kind: "good" } | { kind: "waiting"; untilMs: number; detail: string } | { kind: "gone" };

export const connection = signal<Connection>({ kind: "good" });

/** Refusal of the picture that is asked for; the last good one stays on screen. */
export const pictureRefusal = signal<Refusal | null>(null);

/** Request key that the refusal is about. */
export const refusedKey = computed(() => pictureRefusal.value?.key ?? null);

/** Sentence for screen readers. */
export const announcement = signal("");
