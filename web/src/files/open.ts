import { effect } from "@preact/signals";
import { isAbort, json, Refusal, request, Unreachable } from "../api/client";
import type { Report } from "../api/types";
import { type NamedFile, storeMesh } from "../api/upload";
import { fitIfAway } from "../camera/move";
import { finished, shown } from "../picture/live";
import { queryOf } from "../state/look";
import { capabilities, mesh, type OpenMesh, readingPairs, report } from "../state/mesh";
import { announcement, connection, phase, pictureRefusal } from "../state/phase";
import { strings } from "../strings";
import { sampleObj } from "./sample";

let upload: AbortController | null = null;
let last: NamedFile[] | null = null;

/** The files of the last attempt, for another choice among them. */
export function lastFiles(): NamedFile[] | null {
  return last;
}

/** Checks files, stores them as one mesh and shows it. */
export async function openFiles(files: NamedFile[], entry: string | null = null): Promise<void> {
  const stored = await store(files, entry);
  if (!stored) return;
  show(stored);
}

export function openSample(): Promise<void> {
  const file = new File([sampleObj()], strings.sampleName);
  return openFiles([{ path: strings.sampleName, file }]);
}

/** Stores files as one mesh; null if they are refused, which `phase` then tells. */
export async function store(files: NamedFile[], entry: string | null): Promise<OpenMesh | null> {
  last = files;
  const name = entry ?? nameOf(files);
  const fault = faultOf(files);
  if (fault) {
    refuse(name, fault, "page");
    return null;
  }
  upload?.abort();
  upload = new AbortController();
  phase.value = { kind: "sending", name, share: 0 };
  const query = entry === null ? "" : `?${queryOf([["entry", entry]])}`;
  try {
    const onProgress = (share: number) => (phase.value = { kind: "sending", name, share });
    const stored = await storeMesh(files, query, onProgress, upload.signal);
    connection.value = { kind: "good" };
    return { sha256: stored.sha256, name, entry, formatIn: null, files };
  } catch (error) {
    if (isAbort(error)) {
      phase.value = { kind: mesh.value ? "open" : "empty" };
      return null;
    }
    return failed(error, files, name, entry);
  }
}

export function cancelUpload(): void {
  upload?.abort();
}

async function failed(
  error: unknown,
  files: NamedFile[],
  name: string,
  entry: string | null,
): Promise<OpenMesh | null> {
  if (error instanceof Unreachable) {
    refuse(name, strings.refused.unreachable, "unreachable");
    connection.value = { kind: "gone" };
    return null;
  }
  if (!(error instanceof Refusal)) throw error;
  if (error.status === 429 || error.status === 503) {
    const seconds = error.retryAfterS ?? 1;
    connection.value = { kind: "waiting", untilMs: performance.now() + seconds * 1000, detail: error.message };
    await new Promise((done) => setTimeout(done, seconds * 1000));
    return store(files, entry);
  }
  if (error.status === 401) phase.value = { kind: mesh.value ? "open" : "empty" };
  else refuse(name, error.message, error.problem.code, error.problem.flag ?? null, choicesOf(error, files));
  waitingForKey = error.status === 401 ? () => openFiles(files, entry) : null;
  return null;
}

let waitingForKey: (() => unknown) | null = null;

/** Goes on with what a missing key has stopped. */
export function goOnWithKey(): void {
  const next = waitingForKey;
  waitingForKey = null;
  void next?.();
}

function refuse(name: string, detail: string, code: string, flag: string | null = null, choices: string[] = []): void {
  phase.value = { kind: "refused", name, detail, code, flag, choices };
  announcement.value = detail;
}

/** The files that may be meant where several are meshes: those that the refusal names. */
function choicesOf(error: Refusal, files: NamedFile[]): string[] {
  if (error.problem.code !== "entry_unclear") return [];
  const stated = [...error.message.matchAll(/"((?:[^"\\]|\\.)*)"/g)].map((match) => match[1] ?? "");
  const own = files.map(({ path }) => path).filter((path) => stated.includes(path));
  return own.length > 0 ? own : stated;
}

/** What is wrong with files before any of them is sent; null if nothing is. */
function faultOf(files: NamedFile[]): string | null {
  const limits = capabilities.value?.limits;
  const total = files.reduce((sum, { file }) => sum + file.size, 0);
  if (files.length === 0) return strings.refused.noFiles;
  if (total === 0) return strings.refused.empty;
  if (limits && total > limits.body_bytes) return strings.refused.tooLarge(total, limits.body_bytes);
  if (limits && files.length > limits.bundle_entries)
    return strings.refused.tooMany(files.length, limits.bundle_entries);
  return null;
}

/** Name of the mesh among files: the first whose extension is one of a mesh. */
function nameOf(files: NamedFile[]): string {
  const known = capabilities.value?.mesh_formats ?? [];
  const isMesh = ({ path }: NamedFile) => known.includes(path.split(".").at(-1)?.toLowerCase() ?? "");
  return (files.find(isMesh) ?? files[0])?.path ?? strings.unnamed;
}

function clear(): void {
  for (const one of new Set([shown.value, finished.value])) if (one) URL.revokeObjectURL(one.url);
  shown.value = null;
  finished.value = null;
  pictureRefusal.value = null;
  report.value = null;
}

/** Back to the empty page. */
export function close(): void {
  clear();
  upload?.abort();
  mesh.value = null;
  phase.value = { kind: "empty" };
  document.title = strings.name;
}

/** Shows a stored mesh. */
export function show(open: OpenMesh): void {
  clear();
  mesh.value = open;
  phase.value = { kind: "open" };
  document.title = strings.title(open.name);
}

/** Shows a mesh that a link names, or says that the server has it no longer. */
export async function openStored(open: OpenMesh): Promise<void> {
  try {
    await request(`v1/meshes/${open.sha256}`, { method: "HEAD" });
    show(open);
  } catch (error) {
    if (error instanceof Refusal && error.status === 401) waitingForKey = () => openStored(open);
    else if (error instanceof Unreachable) show(open);
    else phase.value = { kind: "lost", name: open.name, sha256: open.sha256 };
  }
}

/** Sends the files again if the server has lost the mesh and the page still has them. */
export function startRecovery(): void {
  effect(() => {
    if (phase.value.kind !== "lost") return;
    const open = mesh.peek();
    if (open?.files && open.sha256 === phase.value.sha256) void openFiles(open.files, open.entry);
  });
  effect(() => {
    const open = mesh.value;
    if (!open) return;
    const query = queryOf(readingPairs(open));
    json<Report>(`v1/meshes/${open.sha256}${query ? `?${query}` : ""}`)
      .then((found) => {
        if (mesh.peek() !== open) return;
        report.value = found;
        if (open.files) fitIfAway();
      })
      .catch(() => undefined);
  });
}
