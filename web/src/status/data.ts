import { signal } from "@preact/signals";
import { json, Refusal, Unreachable } from "../api/client";
import { needsKey } from "../api/key";
import { strings } from "../strings";

type Counts = Record<string, number>;

/** The answer of v1/status. Any field may be missing: servers differ in age. */
export interface ServerStatus {
  version?: string;
  uptime_s?: number;
  backend?: { default?: string; gpu?: { state?: string; name?: string | null; reason?: string | null } };
  queue?: { class: string; queued?: number; running?: number; oldest_ms?: number | null; wait_ms?: number }[];
  workers?: { busy?: number; all?: number; count?: number };
  memory?: Account[] | { limit_bytes?: number; resident_bytes?: number; accounts?: Account[] };
  caches?: { name: string; entries?: number; bytes?: number; limit_bytes?: number; hits?: number; misses?: number }[];
  kept?: Counts;
  pictures?: Counts;
  quarantined_meshes?: number;
  webhooks_waiting?: number;
  gpu_losses?: number;
  servers?: number;
  shared_queue?: { messages?: Counts; oldest_s?: number };
  failures?: Failure[];
}

export interface Account {
  account: string;
  used_bytes?: number;
  limit_bytes?: number;
}

export interface Failure {
  last_at?: string;
  at?: string;
  place?: string;
  status?: number;
  code?: string;
  detail?: string;
  count?: number;
}

const PERIOD_MS = 2000;

export const status = signal<ServerStatus | null>(null);
export const updated = signal<Date | null>(null);
/** What keeps the page from having news. */
export const trouble = signal<string | null>(null);

let timer: ReturnType<typeof setTimeout> | undefined;

/** Asks now, and then every two seconds while the page is visible. */
export async function poll(): Promise<void> {
  clearTimeout(timer);
  if (document.hidden) return;
  let again = true;
  try {
    status.value = await json<ServerStatus>("v1/status");
    updated.value = new Date();
    trouble.value = null;
  } catch (error) {
    trouble.value = describe(error);
    // Neither a key that is missing nor one that lacks the scope comes by itself.
    again = !(error instanceof Refusal && (error.status === 401 || error.status === 403));
    // Another key may have it.
    if (error instanceof Refusal && error.status === 403) needsKey.value = true;
  }
  clearTimeout(timer);
  if (again) timer = setTimeout(() => void poll(), PERIOD_MS);
}

function describe(error: unknown): string {
  if (error instanceof Unreachable) return strings.connection.gone;
  if (!(error instanceof Refusal)) return String(error);
  if (error.status === 404) return strings.status.missing;
  return error.status === 403 ? strings.status.forbidden : error.message;
}

export function startPolling(): void {
  document.addEventListener("visibilitychange", () => void poll());
  void poll();
}
