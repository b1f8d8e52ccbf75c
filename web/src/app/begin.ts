import { json, Refusal, Unreachable } from "../api/client";
import type { Capabilities } from "../api/types";
import { schema } from "../controls/controls";
import type { Schema } from "../controls/schema";
import { type Offer, savedPresets } from "../picture/thumbnails";
import { lookOf } from "../state/link";
import type { Value } from "../state/look";
import { capabilities } from "../state/mesh";
import { connection } from "../state/phase";

const RETRY_MS = 1500;

/** Asks what the server can do; tries again until it answers. */
export async function begin(): Promise<void> {
  try {
    const [can, document] = await Promise.all([json<Capabilities>("v1/capabilities"), json<Schema>("v1/schema")]);
    capabilities.value = can;
    schema.value = document;
    connection.value = { kind: "good" };
    if (can.paths?.some((path) => path.startsWith("/v1/presets"))) void presets();
  } catch (error) {
    if (error instanceof Refusal && error.status === 401) return;
    if (error instanceof Unreachable) connection.value = { kind: "gone" };
    await new Promise((done) => setTimeout(done, RETRY_MS));
    return begin();
  }
}

/** Looks that are saved on the server, if it has any. */
async function presets(): Promise<void> {
  try {
    const answer = await json<{ presets?: { name: string; request: { [key: string]: Value } }[] }>("v1/presets");
    savedPresets.value = (answer.presets ?? []).map(({ name, request }): Offer => {
      const pairs = Object.entries(request).map(([key, value]): [string, string] => [key, JSON.stringify(value)]);
      return { id: `saved-${name}`, name, look: lookOf(pairs) };
    });
  } catch {
    savedPresets.value = [];
  }
}
