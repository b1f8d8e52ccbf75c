import { signal, useSignalEffect } from "@preact/signals";
import { apiKey } from "../api/key";
import { finished, wanted } from "../picture/live";
import { capabilities, stem } from "../state/mesh";
import { type Picture, pictureAddress } from "../state/address";
import { announcement, pictureRefusal } from "../state/phase";
import { chosenSize, extension, type Format, format, pictureSize, readSize, sizeText } from "../state/size";
import { strings } from "../strings";
import { controlName } from "../controls/ranges";
import { documentAddress, KINDS, type LineKind, lineOf } from "./lines";
import { signedAndTried, worksWithoutKey } from "./sign";

const kind = signal<LineKind>("url");
/** What was copied last, for a moment. */
export const copied = signal<string | null>(null);
const SAID_MS = 3000;
let timer: ReturnType<typeof setTimeout> | undefined;
const custom = signal(false);

/** The signed address of the finished picture, where the page's key makes one. */
const signedAddress = signal<string | null>(null);

/** True once the server has shown a picture without the key that the page has. */
const keyIsNotNeeded = signal(false);

function signWhenAsked(): void {
  signedAddress.value = null;
  const key = apiKey.value;
  const picture = finished.value?.picture;
  if (kind.value !== "signed" || !key || !picture) return;
  const url = pictureAddress(picture);
  const isNewest = () => finished.peek()?.picture === picture && kind.peek() === "signed";
  worksWithoutKey(url)
    .then(async (works) => {
      const made = works ? null : await signedAndTried(url, key);
      if (!isNewest()) return;
      keyIsNotNeeded.value = works;
      signedAddress.value = made;
    })
    .catch(() => undefined);
}

const SIZES = ["256", "512", "1024", "800x600", "1280x720", "1920x1080"];

export async function copyText(text: string, what: string): Promise<void> {
  try {
    await navigator.clipboard.writeText(text);
    copied.value = what;
    announcement.value = what === "share" ? strings.copy.shared : strings.copy.copied;
  } catch {
    copied.value = `${what}-failed`;
    announcement.value = strings.copy.failed;
  }
  clearTimeout(timer);
  timer = setTimeout(() => (copied.value = null), SAID_MS);
}

export function CopyPanel() {
  useSignalEffect(signWhenAsked);
  const picture = wanted.value;
  if (!picture) return null;
  const refusal = pictureRefusal.value;
  const limit = capabilities.value?.limits?.image_px ?? 4096;
  const keyed = apiKey.value !== null;
  const signedText = kind.value === "signed" ? signedAddress.value : null;
  const isOpen = kind.value === "signed" && (!keyed || keyIsNotNeeded.value);
  const text = signedText ?? lineOf(isOpen ? "url" : kind.value, picture, { keyed, limit });
  return (
    <section class="copy" aria-label={strings.copy.heading}>
      <div class="copy-head">
        <OutputControls />
        <span class="spring" />
        <DownloadButton />
      </div>
      <div class="kinds" role="group" aria-label={strings.copy.heading}>
        {KINDS.map((name) => (
          <button
            type="button"
            key={name}
            class="segment"
            aria-pressed={kind.value === name}
            data-test={`copy-${name}`}
            onClick={() => (kind.value = name)}
          >
            {strings.copy.kinds[name]}
          </button>
        ))}
      </div>
      <div class="line">
        <pre tabIndex={0} data-test="copy-text" aria-label={strings.copy.kinds[kind.value]}>
          {text}
        </pre>
        <button
          type="button"
          class="primary"
          data-test="copy"
          disabled={refusal !== null}
          onClick={() => void copyText(text, "line")}
        >
          {copied.value === "line" ? strings.copy.copied : strings.copy.copy}
        </button>
      </div>
      <p class="quiet">
        {refusal
          ? strings.copy.refused(refusal.key && controlName(refusal.key))
          : copied.value === "line-failed"
            ? strings.copy.failed
            : signedText
              ? strings.copy.signedNote
              : isOpen
                ? strings.copy.openNote
                : noteOf(picture, keyed)}
      </p>
    </section>
  );
}

function noteOf(picture: Picture, keyed: boolean): string {
  if (keyed && ["url", "srcset", "markdown"].includes(kind.value)) return strings.copy.keyedNote;
  if (keyed && ["curl", "python", "javascript"].includes(kind.value)) return strings.copy.keyNote;
  if (kind.value === "json") return strings.copy.jsonNote(documentAddress(picture));
  return strings.copy.notes[kind.value];
}

function OutputControls() {
  const value = custom.value ? "custom" : chosenSize.value ? sizeText(chosenSize.value) : "window";
  const pick = (text: string) => {
    custom.value = text === "custom";
    if (text === "window") chosenSize.value = null;
    else if (text !== "custom") chosenSize.value = readSize(text);
    else chosenSize.value ??= pictureSize.value;
  };
  const own = SIZES.includes(value) || value === "window" || value === "custom" ? [] : [value];
  const formats = (capabilities.value?.image_formats ?? ["webp", "png", "jpeg"]) as Format[];
  return (
    <>
      <label>
        {strings.copy.size}
        <select value={value} data-test="size" onChange={(e) => pick(e.currentTarget.value)}>
          <option value="window">
            {chosenSize.value || !wanted.value
              ? strings.copy.windowAlone
              : strings.copy.window(sizeText(wanted.value.size))}
          </option>
          {[...SIZES, ...own].map((size) => (
            <option key={size} value={size}>
              {size.replace("x", " × ")}
            </option>
          ))}
          <option value="custom">{strings.copy.custom}</option>
        </select>
      </label>
      {custom.value && (
        <input
          type="text"
          class="size"
          aria-label={strings.copy.customLabel}
          title={strings.copy.customLabel}
          value={sizeText(pictureSize.value)}
          data-test="size-custom"
          onChange={(e) => {
            const size = readSize(e.currentTarget.value);
            if (size) chosenSize.value = size;
          }}
        />
      )}
      <label>
        {strings.copy.format}
        <select
          value={format.value}
          data-test="format"
          onChange={(e) => (format.value = e.currentTarget.value as Format)}
        >
          {formats.map((name) => (
            <option key={name} value={name}>
              {name}
            </option>
          ))}
        </select>
      </label>
    </>
  );
}

/** Stores the picture that is shown: the very bytes. */
function DownloadButton() {
  const current = finished.value;
  const picture = wanted.value;
  if (!current || !picture) return null;
  const name = `${stem(picture.mesh)}.${extension(current.picture.format)}`;
  if (pictureRefusal.value)
    return (
      <button type="button" disabled data-test="download">
        {strings.copy.download}
      </button>
    );
  return (
    <a class="button" href={current.url} download={name} data-test="download">
      {strings.copy.download}
    </a>
  );
}
