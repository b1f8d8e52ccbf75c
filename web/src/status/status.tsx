import { useRef } from "preact/hooks";
import { keepKey, needsKey } from "../api/key";
import { address } from "../api/base";
import { bytes, count, strings } from "../strings";
import { type Account, poll, type ServerStatus, status, trouble, updated } from "./data";
import { Share, Table } from "./table";

const words = strings.status;

export function Status() {
  const found = status.value;
  return (
    <>
      <header class="top">
        <h1 class="brand">
          {strings.name} · {words.title}
        </h1>
        <span class="spring" />
        <span class="quiet" data-test="updated">
          {updated.value && words.updated(updated.value.toLocaleTimeString())}
        </span>
        <a href={address("metrics")}>{words.metrics}</a>
        <a href={address("")}>{words.page}</a>
      </header>
      <main>
        {trouble.value && (
          <p class="trouble" role="alert" data-test="trouble">
            {trouble.value}
          </p>
        )}
        {needsKey.value && <KeyForm />}
        {found && !needsKey.value && <Tables found={found} />}
      </main>
    </>
  );
}

function KeyForm() {
  const input = useRef<HTMLInputElement>(null);
  const use = (event: Event) => {
    event.preventDefault();
    if (input.current?.value) keepKey(input.current.value.trim());
    void poll();
  };
  return (
    <form class="key" onSubmit={use} data-test="key-form">
      <label>
        {strings.key.label} <input ref={input} type="password" autocomplete="off" data-test="key" />
      </label>
      <button type="submit" class="primary" data-test="key-use">
        {strings.key.save}
      </button>
    </form>
  );
}

function Tables({ found }: { found: ServerStatus }) {
  return (
    <>
      <Tiles found={found} />
      <div class="tables">
        <Table
          name="queue"
          title={words.queue}
          columns={words.queueColumns}
          rows={(found.queue ?? []).map((one) => [
            one.class,
            number(one.queued),
            number(one.running),
            time(one.oldest_ms),
            time(one.wait_ms),
          ])}
        />
        <Memory found={found} />
        <Pictures found={found} />
        <Table name="kept" title={words.kept} columns={words.keptColumns} rows={entries(found.kept)} />
        <Table
          name="caches"
          title={words.caches}
          columns={words.cacheColumns}
          rows={(found.caches ?? []).map((one) => [
            one.name,
            number(one.entries),
            size(one.bytes),
            size(one.limit_bytes),
            number(one.hits),
            number(one.misses),
          ])}
        />
        <Table
          name="shared-queue"
          title={words.shared}
          columns={words.sharedColumns}
          rows={entries(found.shared_queue?.messages)}
        />
      </div>
      <Failures found={found} />
      <Legend />
    </>
  );
}

function Tiles({ found }: { found: ServerStatus }) {
  const { workers, backend } = found;
  const gpu = backend?.gpu;
  const all = workers?.all ?? workers?.count;
  const tiles: [string, string | null, string?][] = [
    [words.version, found.version ?? null],
    [words.uptime, found.uptime_s === undefined ? null : duration(found.uptime_s)],
    [words.workers, all === undefined ? null : words.busy(workers?.busy ?? 0, all)],
    [words.backend, backend?.default ?? null],
    [words.gpu, gpu ? (gpu.name ?? gpu.state ?? null) : null, gpu?.reason ?? undefined],
    [words.gpuLosses, found.gpu_losses ? words.times(found.gpu_losses) : null],
    [words.servers, (found.servers ?? 1) > 1 ? count(found.servers!) : null],
    [words.oldest, found.shared_queue?.oldest_s ? duration(found.shared_queue.oldest_s) : null],
    [words.webhooks, found.webhooks_waiting ? count(found.webhooks_waiting) : null],
    [words.quarantined, found.quarantined_meshes ? count(found.quarantined_meshes) : null],
  ];
  return (
    <dl class="tiles" data-test="tiles">
      {tiles.map(
        ([name, value, help]) =>
          value !== null && (
            <div key={name} title={help}>
              <dt>{name}</dt>
              <dd>{value}</dd>
            </div>
          ),
      )}
    </dl>
  );
}

function Memory({ found }: { found: ServerStatus }) {
  const { memory } = found;
  const accounts = Array.isArray(memory) ? memory : (memory?.accounts ?? []);
  const whole = Array.isArray(memory) ? undefined : memory;
  const rows = accounts.map(accountRow);
  if (whole?.limit_bytes) {
    const used = accounts.reduce((sum, one) => sum + (one.used_bytes ?? 0), 0);
    rows.push(accountRow({ account: words.budget, used_bytes: used, limit_bytes: whole.limit_bytes }));
  }
  if (whole?.resident_bytes) rows.push([words.resident, bytes(whole.resident_bytes), null, null]);
  return <Table name="memory" title={words.memory} columns={words.memoryColumns} rows={rows} />;
}

function accountRow({ account, used_bytes: used, limit_bytes: limit }: Account) {
  return [
    account,
    size(used),
    limit ? bytes(limit) : null,
    limit ? <Share of={used ?? 0} all={limit} isLimit /> : null,
  ];
}

function Pictures({ found }: { found: ServerStatus }) {
  const all = Object.values(found.pictures ?? {}).reduce((a, b) => a + b, 0);
  const rows = Object.entries(found.pictures ?? {}).map(([name, n]) => [name, count(n), <Share of={n} all={all} />]);
  return <Table name="pictures" title={words.pictures} columns={words.pictureColumns} rows={rows} />;
}

function Failures({ found }: { found: ServerStatus }) {
  const rows = (found.failures ?? []).map((one) => [
    moment(one.last_at ?? one.at),
    one.place ?? null,
    one.status ?? null,
    one.code ?? null,
    one.detail ?? null,
    number(one.count),
  ]);
  if (rows.length > 0)
    return (
      <Table name="failures" title={words.failures} columns={words.failureColumns} rows={rows} text={[0, 1, 3, 4]} />
    );
  return (
    <section>
      <h2>{words.failures}</h2>
      <p class="quiet">{words.noFailures}</p>
    </section>
  );
}

/** What the words of the tables mean. */
function Legend() {
  return (
    <section>
      <h2>{words.legend}</h2>
      <dl class="legend" data-test="legend">
        {Object.entries(words.explained).map(([word, meaning]) => (
          <div key={word}>
            <dt>{word}</dt>
            <dd>{meaning}</dd>
          </div>
        ))}
      </dl>
    </section>
  );
}

const number = (n: number | undefined): string | null => (n === undefined ? null : count(n));
const size = (n: number | undefined): string | null => (n === undefined ? null : bytes(n));
const entries = (counts: Record<string, number> | undefined): string[][] =>
  Object.entries(counts ?? {}).map(([name, n]) => [name, count(n)]);

function time(ms: number | null | undefined): string | null {
  if (ms === null || ms === undefined) return null;
  return ms < 1000 ? `${Math.round(ms)} ms` : duration(ms / 1000);
}

function moment(text: string | undefined): string | null {
  const at = text ? new Date(text) : null;
  return at && !Number.isNaN(at.getTime()) ? at.toLocaleString() : (text ?? null);
}

function duration(seconds: number): string {
  const s = Math.floor(seconds);
  const parts: [number, string][] = [
    [Math.floor(s / 86400), "d"],
    [Math.floor(s / 3600) % 24, "h"],
    [Math.floor(s / 60) % 60, "min"],
    [s % 60, "s"],
  ];
  const from = parts.findIndex(([n]) => n > 0);
  return from < 0
    ? "0 s"
    : parts
        .slice(from, from + 2)
        .map(([n, unit]) => `${n} ${unit}`)
        .join(" ");
}
