import { effect, signal } from "@preact/signals";
import { PictureLoop, type Shown } from "../picture/loop";
import { draftOf, moving, wanted } from "../picture/live";
import type { Picture } from "../state/address";
import { isView, type Look } from "../state/look";
import { look } from "../state/history";
import { mesh, type OpenMesh } from "../state/mesh";
import { pictureRefusal } from "../state/phase";

/** What is compared with the picture of now: a look that was kept, or another mesh. */
export interface Compared {
  look: Look;
  mesh: OpenMesh | null;
}

export const compare = signal<Compared | null>(null);
/** Its picture. */
export const besideShown = signal<Shown | null>(null);
export const besideFinished = signal<Shown | null>(null);
/** The divider, in shares of the width. */
export const divider = signal(0.5);
export const heat = signal(false);

const loop = new PictureLoop({
  shown(next) {
    const before = besideShown.value;
    besideShown.value = next;
    if (!next.draft) besideFinished.value = next;
    if (before && before !== besideFinished.value) setTimeout(() => URL.revokeObjectURL(before.url), 1000);
  },
  refused: (refusal) => (pictureRefusal.value = refusal),
  busy: () => undefined,
});

/** Its picture: its own look, seen as the picture of now is. */
export function besideOf(picture: Picture, compared: Compared): Picture {
  const view = Object.entries(picture.look.keys).filter(
    ([key]) => isView(key) || /^camera\.(up|projection|fov_deg|margin)$/.test(key),
  );
  const kept = Object.entries(compared.look.keys).filter(([key]) => !key.startsWith("camera."));
  if (compared.mesh) return { ...picture, mesh: compared.mesh };
  return { ...picture, look: { ...compared.look, keys: Object.fromEntries([...kept, ...view]) } };
}

export function startCompare(): void {
  effect(() => {
    const picture = wanted.value;
    if (!compare.value || !picture) {
      besideShown.value = null;
      besideFinished.value = null;
      return loop.stop();
    }
    const own = besideOf(picture, compare.value);
    loop.want(moving.value ? draftOf(own) : own, moving.value);
  });
}

export function keepLook(): void {
  compare.value = { look: look.value, mesh: null };
}

export function compareMesh(other: OpenMesh): void {
  compare.value = { look: look.value, mesh: other };
}

export function endCompare(): void {
  compare.value = null;
  heat.value = false;
}

/** True if the mesh beside is another one than the mesh that is open. */
export function isOtherMesh(): boolean {
  return compare.value?.mesh !== null && compare.value?.mesh?.sha256 !== mesh.value?.sha256;
}
