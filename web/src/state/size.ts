import { computed, signal } from "@preact/signals";
import { capabilities } from "./mesh";

export type Format = "webp" | "png" | "jpeg";
export interface Size {
  width: number;
  height: number;
}

/** The size that was chosen; null: that of the window. */
export const chosenSize = signal<Size | null>(null);
export const format = signal<Format>("webp");

/** Room for the picture in CSS pixels, and device pixels for each. */
export const room = signal<Size>({ width: 0, height: 0 });
export const density = signal(Math.min(window.devicePixelRatio || 1, 3));

const limit = computed(() => capabilities.value?.limits?.image_px ?? 4096);

/** Size of the finished picture in pixels. */
export const pictureSize = computed<Size>(() => {
  if (chosenSize.value) return within(chosenSize.value, limit.value);
  const { width, height } = room.value;
  return within({ width: width * density.value, height: height * density.value }, limit.value);
});

/** Size on screen in CSS pixels: as large as the room allows, and no larger than its pixels. */
export const shownSize = computed<Size>(() => {
  if (!chosenSize.value) return room.value;
  const { width, height } = pictureSize.value;
  const share = Math.min(1, room.value.width / width, room.value.height / height);
  return { width: Math.max(1, Math.round(width * share)), height: Math.max(1, Math.round(height * share)) };
});

/** Whole pixels with the same proportions, at most `most` a side. */
export function within(size: Size, most: number): Size {
  const share = Math.min(1, most / Math.max(size.width, size.height, 1));
  const side = (n: number) => Math.max(1, Math.round(n * share));
  return { width: side(size.width), height: side(size.height) };
}

export function sizeText({ width, height }: Size): string {
  return width === height ? String(width) : `${width}x${height}`;
}

/** Reads `N` or `WxH`; null if it is neither. */
export function readSize(text: string): Size | null {
  const found = /^\s*(\d{1,5})(?:\s*[x×]\s*(\d{1,5}))?\s*$/i.exec(text);
  if (!found) return null;
  const width = Number(found[1]);
  const height = Number(found[2] ?? found[1]);
  return width > 0 && height > 0 ? { width, height } : null;
}

export const extension = (f: Format): string => (f === "jpeg" ? "jpg" : f);
