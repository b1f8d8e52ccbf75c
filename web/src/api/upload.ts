import { address } from "./base";
import { headers, refusalOf, Unreachable } from "./client";
import type { StoredMesh } from "./types";

/** A file and its path relative to what was dropped. */
export interface NamedFile {
  path: string;
  file: File;
}

/** Sends a mesh. XMLHttpRequest, because fetch does not report the progress of a body. */
export function storeMesh(
  files: NamedFile[],
  query: string,
  onProgress: (share: number) => void,
  signal: AbortSignal,
): Promise<StoredMesh> {
  return new Promise((resolve, reject) => {
    const xhr = new XMLHttpRequest();
    xhr.open("POST", address(`v1/meshes${query}`));
    for (const [name, value] of Object.entries(headers())) xhr.setRequestHeader(name, value);
    xhr.upload.onprogress = (event) => {
      if (event.lengthComputable) onProgress(event.loaded / event.total);
    };
    xhr.onerror = () => reject(new Unreachable("upload"));
    xhr.onabort = () => reject(new DOMException("ended", "AbortError"));
    xhr.onload = () => {
      if (xhr.status >= 200 && xhr.status < 300) resolve(JSON.parse(xhr.responseText) as StoredMesh);
      else reject(refusalOf(xhr.status, xhr.statusText, xhr.responseText, xhr.getResponseHeader("retry-after")));
    };
    signal.addEventListener("abort", () => xhr.abort());
    xhr.send(bodyOf(files));
  });
}

/** The body: one file as it is, several as a form whose file names are relative paths. */
function bodyOf(files: NamedFile[]): Blob | FormData {
  const only = files.length === 1 ? files[0] : undefined;
  // A type of its own keeps the browser from stating one by the file's name.
  if (only) return new Blob([only.file], { type: "application/octet-stream" });
  const form = new FormData();
  for (const { path, file } of files) form.append("file", file, path);
  return form;
}
