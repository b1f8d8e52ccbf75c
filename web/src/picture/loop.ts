import { isAbort, Refusal, request, Unreachable } from "../api/client";
import { type Picture, picturePath } from "../state/address";
import { connection } from "../state/phase";

/** A picture that has arrived. */
export interface Shown {
  picture: Picture;
  path: string;
  draft: boolean;
  /** Address of its bytes in this page. */
  url: string;
  bytes: Blob;
  headers: Headers;
  tookMs: number;
}

interface Order {
  picture: Picture;
  draft: boolean;
  /** What is fetched after it, unless something newer waits. */
  then?: Order;
}

interface Listener {
  shown(shown: Shown): void;
  refused(refusal: Refusal): void;
  busy(busy: boolean): void;
}

const GONE_RETRY_MS = 1500;
const OVERLOAD_RETRY_S = 1;

/**
 * Fetches pictures, one at a time. While one is under way, only the newest order waits. A draft is
 * let finish when another draft waits, so that a drag shows movement; all else is ended.
 */
export class PictureLoop {
  private running: { order: Order; abort: AbortController } | null = null;
  private waiting: Order | null = null;
  private timer: ReturnType<typeof setTimeout> | undefined;

  constructor(private readonly listener: Listener) {}

  want(picture: Picture, draft: boolean): void {
    this.take({ picture, draft });
  }

  /** Asks for a draft and then for the whole: for pictures that take long. */
  wantBoth(draft: Picture, picture: Picture): void {
    this.take({ picture: draft, draft: true, then: { picture, draft: false } });
  }

  private take(order: Order): void {
    this.waiting = order;
    if (this.running && !(this.running.order.draft && order.draft)) this.running.abort.abort();
    if (!this.running) this.next();
  }

  /** Forgets what waits and ends what runs. */
  stop(): void {
    clearTimeout(this.timer);
    this.waiting = null;
    this.running?.abort.abort();
    this.listener.busy(false);
  }

  private next(): void {
    clearTimeout(this.timer);
    const order = this.waiting;
    this.waiting = null;
    if (!order) return this.listener.busy(false);
    const abort = new AbortController();
    this.running = { order, abort };
    this.listener.busy(true);
    void this.fetch(order, abort.signal).then((retryMs) => {
      this.running = null;
      if (retryMs === null && !abort.signal.aborted) this.waiting ??= order.then ?? null;
      if (retryMs === null || this.waiting) return this.next();
      this.waiting = order;
      this.timer = setTimeout(() => this.next(), retryMs);
    });
  }

  /** Fetches one picture; the answer is the time after which to try again, or null. */
  private async fetch(order: Order, signal: AbortSignal): Promise<number | null> {
    const path = picturePath(order.picture);
    const began = performance.now();
    try {
      const answer = await request(path, { signal });
      const bytes = await answer.blob();
      const url = URL.createObjectURL(bytes);
      await decoded(url);
      if (signal.aborted) {
        URL.revokeObjectURL(url);
        return null;
      }
      connection.value = { kind: "good" };
      const tookMs = performance.now() - began;
      this.listener.shown({
        picture: order.picture,
        draft: order.draft,
        path,
        url,
        bytes,
        headers: answer.headers,
        tookMs,
      });
      return null;
    } catch (error) {
      return signal.aborted || isAbort(error) ? null : this.failed(error);
    }
  }

  private failed(error: unknown): number | null {
    if (error instanceof Unreachable) {
      connection.value = { kind: "gone" };
      return GONE_RETRY_MS;
    }
    if (error instanceof Refusal && (error.status === 429 || error.status === 503)) {
      const seconds = error.retryAfterS ?? OVERLOAD_RETRY_S;
      connection.value = { kind: "waiting", untilMs: performance.now() + seconds * 1000, detail: error.message };
      return seconds * 1000;
    }
    connection.value = { kind: "good" };
    if (error instanceof Refusal) this.listener.refused(error);
    else throw error;
    return null;
  }
}

/** Decodes a picture before it is shown, so that there is no moment without one. */
async function decoded(url: string): Promise<void> {
  const image = new Image();
  image.src = url;
  await image.decode();
}
