import { signal } from "@preact/signals";

const ITEM = "meshsnap-key";

function stored(): string | null {
  try {
    return sessionStorage.getItem(ITEM);
  } catch {
    return null;
  }
}

/** The key of the server's interface, for this tab. */
export const apiKey = signal<string | null>(stored());

/** True while the server wants a key that the page does not have. */
export const needsKey = signal(false);

/** True after a key that the server has not taken. */
export const keyIsWrong = signal(false);

export function keepKey(key: string): void {
  try {
    sessionStorage.setItem(ITEM, key);
  } catch {
    // Without storage the key lasts until the page is left.
  }
  apiKey.value = key;
  keyIsWrong.value = false;
  needsKey.value = false;
}

export function forgetKey(): void {
  try {
    sessionStorage.removeItem(ITEM);
  } catch {
    // Nothing was stored.
  }
  apiKey.value = null;
}
