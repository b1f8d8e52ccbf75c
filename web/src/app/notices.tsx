import { signal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { announcement, connection } from "../state/phase";
import { strings } from "../strings";

const now = signal(0);

/** State of the connection while it is not good, and the live region. */
export function Notices() {
  const state = connection.value;
  const waits = state.kind === "waiting";
  useEffect(() => {
    if (!waits) return;
    now.value = performance.now();
    const timer = setInterval(() => (now.value = performance.now()), 250);
    return () => clearInterval(timer);
  }, [waits]);
  return (
    <>
      {state.kind === "gone" && (
        <div class="notice" role="status" data-test="gone">
          {strings.connection.gone}
        </div>
      )}
      {waits && (
        <div class="notice" role="status" data-test="waiting" title={state.detail}>
          {strings.connection.waiting(Math.max(1, Math.ceil((state.untilMs - now.value) / 1000)))}
        </div>
      )}
      <div class="unseen" aria-live="polite" data-test="live">
        {announcement.value}
      </div>
    </>
  );
}
