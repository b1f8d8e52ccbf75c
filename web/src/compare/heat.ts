/** Difference of two pictures, pixel by pixel. */
export interface HeatFigures {
  /** Root of the mean squared difference of colours, of 255. */
  rmse: number;
  /** Largest difference of one channel. */
  most: number;
  /** Share of pixels that differ. */
  share: number;
}

/** Paints the differences of two pictures, and counts them; null if their sizes differ. */
export async function paintHeat(canvas: HTMLCanvasElement, a: Blob, b: Blob): Promise<HeatFigures | null> {
  const [left, right] = await Promise.all([pixels(a), pixels(b)]);
  if (!left || !right || left.width !== right.width || left.height !== right.height) return null;
  canvas.width = left.width;
  canvas.height = left.height;
  const context = canvas.getContext("2d");
  if (!context) return null;
  const out = context.createImageData(left.width, left.height);
  const figures = fill(out.data, left.data, right.data);
  context.putImageData(out, 0, 0);
  return figures;
}

async function pixels(blob: Blob): Promise<ImageData | null> {
  const bitmap = await createImageBitmap(blob);
  const canvas = document.createElement("canvas");
  canvas.width = bitmap.width;
  canvas.height = bitmap.height;
  const context = canvas.getContext("2d", { willReadFrequently: true });
  if (!context) return null;
  context.drawImage(bitmap, 0, 0);
  return context.getImageData(0, 0, bitmap.width, bitmap.height);
}

function fill(out: Uint8ClampedArray, a: Uint8ClampedArray, b: Uint8ClampedArray): HeatFigures {
  let [sum, most, differing] = [0, 0, 0];
  for (let i = 0; i < a.length; i += 4) {
    let largest = 0;
    for (let c = 0; c < 4; c++) {
      const d = Math.abs((a[i + c] ?? 0) - (b[i + c] ?? 0));
      if (d > largest) largest = d;
      if (c < 3) sum += d * d;
    }
    if (largest > 0) differing++;
    if (largest > most) most = largest;
    const grey = 0.2 * (((a[i] ?? 0) + (a[i + 1] ?? 0) + (a[i + 2] ?? 0)) / 3);
    colour(out, i, largest, grey);
  }
  const count = a.length / 4;
  return { rmse: Math.sqrt(sum / (3 * count)), most, share: differing / count };
}

/** Dark where the pictures agree, then from violet over red to yellow; small differences show, too. */
function colour(out: Uint8ClampedArray, i: number, difference: number, grey: number): void {
  const t = difference === 0 ? 0 : 0.25 + 0.75 * Math.sqrt(difference / 255);
  const mix = (to: number) => grey * (1 - t) + to * t;
  out[i] = mix(255 * Math.min(1, 0.35 + t));
  out[i + 1] = mix(255 * Math.max(0, 1.9 * t - 0.8));
  out[i + 2] = mix(255 * Math.max(0, 0.75 - t));
  out[i + 3] = 255;
}
