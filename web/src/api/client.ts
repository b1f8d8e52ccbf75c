import { address } from "./base";
import { apiKey, forgetKey, keyIsWrong, needsKey } from "./key";
import type { Problem } from "./types";

/** Refusal by the server, in its own words. */
export class Refusal extends Error {
  constructor(
    readonly problem: Problem,
    readonly retryAfterS: number | null,
  ) {
    super(problem.detail || problem.title);
  }

  get status(): number {
    return this.problem.status;
  }

  /** The request key that the refusal is about, if it names one. */
  get key(): string | null {
    const stated = (this.problem as { param?: string }).param;
    return stated ?? /`([a-z_]+(?:\.[^`]+)?)`/.exec(this.problem.detail)?.[1] ?? null;
  }
}

/** Failure to reach the server at all. */
export class Unreachable extends Error {}

/** Headers of a request, with the key if there is one. */
export function headers(more: Record<string, string> = {}): Record<string, string> {
  const key = apiKey.value;
  return key ? { ...more, Authorization: `Bearer ${key}` } : more;
}

/** Makes a refusal of an answer, also of one that is not a problem document. */
export function refusalOf(status: number, title: string, text: string, retryAfter: string | null): Refusal {
  let problem: Problem;
  try {
    problem = JSON.parse(text) as Problem;
    if (typeof problem.status !== "number") throw new Error();
  } catch {
    const detail = `${status} ${title}`.trim();
    problem = { type: "urn:meshsnap:error:unknown", title, status, detail, code: "unknown", request_id: "" };
  }
  if (status === 401) {
    keyIsWrong.value ||= apiKey.value !== null;
    forgetKey();
    needsKey.value = true;
  }
  const seconds = Number(retryAfter);
  return new Refusal(problem, retryAfter !== null && Number.isFinite(seconds) ? seconds : null);
}

/** Sends a request; an answer that is not a success is thrown as a `Refusal`. */
export async function request(path: string, init: RequestInit = {}): Promise<Response> {
  let answer: Response;
  try {
    const given = init.headers as Record<string, string> | undefined;
    answer = await fetch(address(path), { ...init, headers: headers(given), credentials: "same-origin" });
  } catch (error) {
    if (init.signal?.aborted) throw error;
    throw new Unreachable(String(error));
  }
  if (answer.ok) return answer;
  throw refusalOf(answer.status, answer.statusText, await answer.text(), answer.headers.get("retry-after"));
}

/** Asks for JSON. */
export async function json<T>(path: string, init: RequestInit = {}): Promise<T> {
  return (await request(path, init)).json() as Promise<T>;
}

/** Posts JSON and asks for JSON. */
export function postJson<T>(path: string, body: unknown, init: RequestInit = {}): Promise<T> {
  const sent = { ...init, method: "POST", body: JSON.stringify(body), headers: { "Content-Type": "application/json" } };
  return json<T>(path, sent);
}

/** True for the error of a request that the page itself has ended. */
export function isAbort(error: unknown): boolean {
  return error instanceof DOMException && error.name === "AbortError";
}
