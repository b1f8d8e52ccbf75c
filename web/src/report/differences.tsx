import { signal, useSignalEffect } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { postJson, request } from "../api/client";
import type { Difference } from "../api/types";
import { angles } from "../camera/move";
import { compare } from "../compare/state";
import { mesh } from "../state/mesh";
import { strings } from "../strings";

const words = strings.compare;
const result = signal<{ key: string; difference: Difference | null; failed: string | null } | null>(null);
const picture = signal<{ url: string } | "drawing" | { failed: string } | null>(null);

function sides(): { a: string; b: string } | null {
  const [a, b] = [mesh.value?.sha256, compare.value?.mesh?.sha256];
  return a && b ? { a, b } : null;
}

async function differ(both: { a: string; b: string }): Promise<void> {
  const key = both.a + both.b;
  if (result.peek()?.key === key) return;
  result.value = { key, difference: null, failed: null };
  picture.value = null;
  try {
    const difference = await postJson<Difference>("v1/diff", both);
    if (result.peek()?.key === key) result.value = { key, difference, failed: null };
  } catch (error) {
    result.value = { key, difference: null, failed: error instanceof Error ? error.message : String(error) };
  }
}

/** Asks for the distances of both meshes as the server's picture. */
async function draw(both: { a: string; b: string }): Promise<void> {
  const { azimuth, elevation } = angles();
  const query = `format=webp&size=960x480&camera.azimuth_deg=${azimuth}&camera.elevation_deg=${elevation}`;
  const init = { method: "POST", body: JSON.stringify(both), headers: { "Content-Type": "application/json" } };
  picture.value = "drawing";
  try {
    picture.value = { url: URL.createObjectURL(await (await request(`v1/diff?${query}`, init)).blob()) };
  } catch (error) {
    picture.value = { failed: error instanceof Error ? error.message : String(error) };
  }
}

function DistancePicture({ both }: { both: { a: string; b: string } }) {
  const state = picture.value;
  if (state === "drawing") return <p class="quiet">{strings.loading}</p>;
  if (state && "url" in state) return <img src={state.url} alt={words.heatPicture} data-test="distances" />;
  return (
    <>
      {state && <p class="quiet">{state.failed}</p>}
      <button type="button" class="small" onClick={() => void draw(both)} data-test="distance-picture">
        {words.heatPicture}
      </button>
    </>
  );
}

/** What differs between the two meshes that are compared. */
export function Differences() {
  useSignalEffect(() => {
    const both = sides();
    if (both) void differ(both);
  });
  const both = sides();
  const found = result.value;
  if (!both || !found) return null;
  return (
    <section class="differences" data-test="differences">
      <h2>{words.differences}</h2>
      {!found.difference && !found.failed && <p class="quiet">{strings.loading}</p>}
      {found.failed && <p class="quiet">{found.failed}</p>}
      {found.difference && <Summary difference={found.difference} />}
      <DistancePicture both={both} />
    </section>
  );
}

function Summary({ difference: { same, summary, geometry } }: { difference: Difference }) {
  const list = useRef<HTMLUListElement>(null);
  useEffect(() => list.current?.scrollTo(0, 0), [summary]);
  if (same) return <p>{words.sameMesh}</p>;
  const distance = (n: number | null) => (n === null ? "–" : String(Number(n.toPrecision(4))));
  return (
    <>
      <ul ref={list} class="warnings">
        {summary.map((line) => (
          <li key={line}>{line}</li>
        ))}
      </ul>
      {!geometry.same && <p class="quiet">{words.distance(distance(geometry.hausdorff), distance(geometry.mean))}</p>}
    </>
  );
}
