import { effect, signal } from "@preact/signals";
import { Refusal, request } from "../api/client";
import { picturePath } from "../state/address";
import { look } from "../state/history";
import { effective, isView, type Look, type Value } from "../state/look";
import { capabilities, mesh } from "../state/mesh";
import { pictureRefusal } from "../state/phase";
import { scaledLook } from "../state/scaled";
import { busy, finished, moving } from "./live";
import { PRESETS } from "./presets";

/** A look to choose, beside what it adds to the look that is shown. */
export interface Offer {
  id: string;
  name: string;
  look: Look;
}

export const thumbnails = signal<Readonly<Record<string, string>>>({});
export const savedPresets = signal<Offer[]>([]);

const SIDE_PX = Math.round(88 * Math.min(2, Math.max(1, window.devicePixelRatio || 1)));

/** Lines of thumbnails against those of the picture: finer, but not so fine that they vanish. */
const LINE_SHARE = 0.4;

export function styleOffers(): Offer[] {
  return (capabilities.value?.styles ?? []).map((style) => ({
    id: `style-${style}`,
    name: style,
    look: { keys: { ...look.value.keys, style }, materials: look.value.materials },
  }));
}

export function presetOffers(): Offer[] {
  const offers = PRESETS.map(({ name, look: own }) => ({ id: `preset-${name.replaceAll(" ", "-")}`, name, look: own }));
  return [...offers, ...savedPresets.value];
}

/** The look of a thumbnail: an offer from the direction of now, small, with the whole mesh in sight. */
function small(own: Look): Look {
  const view = Object.entries(look.peek().keys).filter(
    ([key]) => isView(key) || key === "camera.up" || key === "scene.time_s",
  );
  const keys: Record<string, Value> = { ...own.keys, ...Object.fromEntries(view) };
  // A grid in place of an animation, which would draw the eye away from the picture.
  if (typeof keys["sheet.turntable"] === "number") Object.assign(keys, { "sheet.turntable": 4, "sheet.columns": 2 });
  return scaledLook(effective({ keys, materials: own.materials }), LINE_SHARE);
}

let round = 0;

/** Draws thumbnails one after the other, whenever no picture is under way. */
export function startThumbnails(): () => void {
  let of: string | null = null;
  return effect(() => {
    const open = mesh.value;
    if (open && open.sha256 !== of) forget();
    of = open?.sha256 ?? of;
    const ready = finished.value;
    if (pictureRefusal.value || !open || !ready || moving.value || busy.value || ready.picture.mesh !== open) return;
    const offers = [...styleOffers(), ...presetOffers()];
    const own = ++round;
    const timer = setTimeout(() => void draw(offers, own), 250);
    return () => {
      round++;
      clearTimeout(timer);
    };
  });
}

/** Asks for a picture, and again when a busy server says so. */
async function patient(path: string): Promise<Blob> {
  for (;;) {
    try {
      return await (await request(path)).blob();
    } catch (error) {
      if (!(error instanceof Refusal) || error.retryAfterS === null) throw error;
      await new Promise((done) => setTimeout(done, 1000 * (error.retryAfterS ?? 1)));
    }
  }
}

const addresses = new Map<string, string>();

/** Takes the pictures of another mesh away. */
function forget(): void {
  for (const url of Object.values(thumbnails.peek())) URL.revokeObjectURL(url);
  addresses.clear();
  thumbnails.value = {};
}

async function draw(offers: Offer[], own: number): Promise<void> {
  for (const offer of offers) {
    const open = mesh.peek();
    if (own !== round || !open) return;
    const size = { width: SIDE_PX, height: SIDE_PX };
    const path = picturePath({ mesh: open, look: small(offer.look), size, format: "webp" });
    if (addresses.get(offer.id) === path) continue;
    try {
      const url = URL.createObjectURL(await patient(path));
      if (own !== round) return URL.revokeObjectURL(url);
      const before = thumbnails.peek()[offer.id];
      thumbnails.value = { ...thumbnails.peek(), [offer.id]: url };
      addresses.set(offer.id, path);
      if (before) setTimeout(() => URL.revokeObjectURL(before), 1000);
    } catch {
      // A look that the server refuses keeps its empty place.
    }
  }
}
