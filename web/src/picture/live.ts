import { computed, effect, signal } from "@preact/signals";
import { needsKey } from "../api/key";
import { anglesOf } from "../camera/orbit";
import type { Picture } from "../state/address";
import { look } from "../state/history";
import type { Keys, Look } from "../state/look";
import { capabilities, mesh, report } from "../state/mesh";
import { announcement, phase, pictureRefusal } from "../state/phase";
import { chosenSize, format, pictureSize, shownSize, type Size, within } from "../state/size";
import { scaledLook } from "../state/scaled";
import { strings } from "../strings";
import { PictureLoop, type Shown } from "./loop";

/** The newest picture, drafts too. */
export const shown = signal<Shown | null>(null);
/** The newest picture of full size. */
export const finished = signal<Shown | null>(null);
export const busy = signal(false);

/** True while something is dragged: pictures are then small, so that they come quickly. */
export const moving = signal(false);

const SETTLE_MS = 180;
const DRAFT_GOAL_MS = 60;
const SLOW_MS = 400;
let draftSide = 320;
let settle: ReturnType<typeof setTimeout> | undefined;

/** Says that something moves for now: by a wheel, a key or a slider, which have no clear end. */
export function touch(): void {
  moving.value = true;
  clearTimeout(settle);
  settle = setTimeout(() => (moving.value = false), SETTLE_MS);
}

/** Says that a drag begins or ends. */
export function hold(active: boolean): void {
  clearTimeout(settle);
  moving.value = active;
}

/** Adapts the size of drafts to the time that they take. */
function learn({ draft, tookMs }: Shown): void {
  if (!draft) return;
  if (tookMs > DRAFT_GOAL_MS * 1.1) draftSide = Math.max(128, draftSide * 0.88);
  else if (tookMs < DRAFT_GOAL_MS * 0.6) draftSide = Math.min(720, draftSide * 1.06);
}

/** What a picture shows, for those who do not see it. */
function described({ look }: Picture): string {
  const up = String(look.keys["camera.up"] ?? report.peek()?.up ?? "y");
  const { azimuth, elevation } = anglesOf(look.keys, up);
  return strings.picture.announced(String(look.keys["style"] ?? "auto"), Math.round(azimuth), Math.round(elevation));
}

export const loop = new PictureLoop({
  shown(next) {
    learn(next);
    const previous = shown.value;
    shown.value = next;
    pictureRefusal.value = null;
    if (!next.draft) {
      const last = finished.value;
      finished.value = next;
      announcement.value = described(next.picture);
      if (last && last !== previous) URL.revokeObjectURL(last.url);
    }
    if (previous && previous !== finished.value) setTimeout(() => URL.revokeObjectURL(previous.url), 1000);
  },
  refused(refusal) {
    if (refusal.problem.code === "mesh_unknown" && mesh.value) {
      phase.value = { kind: "lost", name: mesh.value.name, sha256: mesh.value.sha256 };
      return;
    }
    if (refusal.status !== 401) {
      pictureRefusal.value = refusal;
      announcement.value = refusal.message;
    }
  },
  busy: (is) => (busy.value = is),
});

/** The picture that the page asks for, at full size. */
export const wanted = computed<Picture | null>(() => {
  if (!mesh.value || phase.value.kind !== "open") return null;
  if (pictureSize.value.width < 2) return null;
  const size = chosenSize.value ? pictureSize.value : roomForTurns(pictureSize.value, look.value.keys);
  return { mesh: mesh.value, look: look.value, size, format: format.value };
});

/** The size of a turntable's frames: all of them together have at most the pixels of the largest picture. */
function roomForTurns(size: Size, keys: Keys): Size {
  const turns = keys["sheet.turntable"];
  if (typeof turns !== "number" || "sheet.columns" in keys) return size;
  const most = (capabilities.value?.limits?.image_px ?? 4096) ** 2;
  const share = Math.sqrt(most / (turns * (size.width + 1) * (size.height + 1)));
  return within(size, Math.floor(Math.max(size.width, size.height) * Math.min(1, share)));
}

/** A small picture of the same: quick to draw, with the same proportions. */
export function draftOf(picture: Picture): Picture {
  const size = within(picture.size, draftMost(picture.size));
  const keys = { ...picture.look.keys };
  // One view of a turntable is enough while it is turned.
  if ("sheet.turntable" in keys) for (const key of Object.keys(keys)) if (/^sheet\b/.test(key)) delete keys[key];
  if (!("image.samples" in keys) && !("image.max_error" in keys)) keys["image.samples"] = 4;
  const look = scaledLook({ ...picture.look, keys }, size.width / picture.size.width);
  return { ...picture, look, size, format: "webp" };
}

function draftMost(size: Size): number {
  const onScreen = Math.max(shownSize.value.width, shownSize.value.height);
  return Math.round(Math.min(draftSide, onScreen, Math.max(size.width, size.height)) / 8) * 8 || 8;
}

/** The look of the last draft. */
let drafted: Look | null = null;

/** True if pictures of full size take so long that a draft is welcome before them. */
function isSlow(): boolean {
  return (finished.peek()?.tookMs ?? 0) > SLOW_MS;
}

/** Asks for pictures whenever what is wanted changes. */
export function startPictures(): () => void {
  return effect(() => {
    const picture = wanted.value;
    if (!picture || needsKey.value) return loop.stop();
    const isNew = drafted !== picture.look && finished.peek()?.picture.look !== picture.look;
    if (moving.value) loop.want(draftOf(picture), true);
    else if (isNew && isSlow()) loop.wantBoth(draftOf(picture), picture);
    else return loop.want(picture, false);
    drafted = picture.look;
  });
}
