import type { NamedFile } from "../api/upload";

/** Files and folders of a drop, with their paths. Must be called before the event has ended. */
export async function filesOfDrop(data: DataTransfer): Promise<NamedFile[]> {
  const items = [...data.items].filter((item) => item.kind === "file");
  const entries = items.map((item) => ({ entry: item.webkitGetAsEntry?.() ?? null, file: item.getAsFile() }));
  const found: NamedFile[] = [];
  for (const { entry, file } of entries) {
    if (entry) await walk(entry, "", found);
    else if (file) found.push({ path: file.name, file });
  }
  return relative(found);
}

async function walk(entry: FileSystemEntry, folder: string, found: NamedFile[]): Promise<void> {
  const path = folder + entry.name;
  if (entry.isFile) {
    const file = await new Promise<File>((done, fail) => (entry as FileSystemFileEntry).file(done, fail));
    found.push({ path, file });
    return;
  }
  const reader = (entry as FileSystemDirectoryEntry).createReader();
  // A reader gives a part of a large folder at a time, and an empty part at its end.
  for (;;) {
    const part = await new Promise<FileSystemEntry[]>((done, fail) => reader.readEntries(done, fail));
    if (part.length === 0) return;
    for (const child of part) await walk(child, `${path}/`, found);
  }
}

/** Files of an input, with their paths if a folder was chosen. */
export function filesOfInput(list: FileList): NamedFile[] {
  return relative([...list].map((file) => ({ path: file.webkitRelativePath || file.name, file })));
}

/** Leaves out hidden files, and the folder that all others lie in. */
function relative(files: NamedFile[]): NamedFile[] {
  const seen = files.filter(({ path }) => !path.split("/").some((part) => part.startsWith(".")));
  const first = seen[0]?.path.split("/")[0];
  const nested = first !== undefined && seen.every(({ path }) => path.startsWith(`${first}/`));
  if (!nested) return seen;
  return seen.map(({ path, file }) => ({ path: path.slice(first.length + 1), file }));
}
