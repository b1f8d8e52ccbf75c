const DAY_S = 86_400;
const HOUR_S = 3600;

const hex = (bytes: ArrayBuffer): string =>
  [...new Uint8Array(bytes)].map((b) => b.toString(16).padStart(2, "0")).join("");

/**
 * Adds `exp` and `sig` to an address, as `meshsnap sign` does: an HMAC of path and query by the digest of the
 * key. The time is a day from the next full hour, so that the address stays the same for a while. Null where
 * the browser has no cryptography, as on pages without HTTPS.
 */
export async function signed(url: string, key: string): Promise<string | null> {
  if (!globalThis.crypto?.subtle) return null;
  const text = new TextEncoder();
  const expires = Math.ceil(Date.now() / 1000 / HOUR_S) * HOUR_S + DAY_S;
  const address = `${url}&exp=${expires}`;
  const secret = hex(await crypto.subtle.digest("SHA-256", text.encode(key)));
  const algorithm = { name: "HMAC", hash: "SHA-256" };
  const hmacKey = await crypto.subtle.importKey("raw", text.encode(secret), algorithm, false, ["sign"]);
  const signature = await crypto.subtle.sign("HMAC", hmacKey, text.encode(address.slice(new URL(url).origin.length)));
  return `${address}&sig=${hex(signature)}`;
}

/** True if the server shows the address without a key. What the browser has kept was fetched with one. */
export async function worksWithoutKey(url: string): Promise<boolean> {
  return (await fetch(url, { method: "HEAD", credentials: "omit", cache: "no-store" })).ok;
}

/** The signed address, if the server shows it without a key: it takes signatures by its first key alone. */
export async function signedAndTried(url: string, key: string): Promise<string | null> {
  const address = await signed(url, key);
  if (!address) return null;
  return (await worksWithoutKey(address)) ? address : null;
}
