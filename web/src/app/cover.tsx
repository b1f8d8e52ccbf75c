import { useRef } from "preact/hooks";
import { address } from "../api/base";
import { keepKey, keyIsWrong, needsKey } from "../api/key";
import type { NamedFile } from "../api/upload";
import { filesOfInput } from "../files/drop";
import { cancelUpload, goOnWithKey, lastFiles, openFiles, openSample } from "../files/open";
import { capabilities, mesh } from "../state/mesh";
import { phase } from "../state/phase";
import { strings } from "../strings";
import { begin } from "./begin";

/** What stands in place of the picture while there is none. */
export function Cover() {
  const state = phase.value;
  if (needsKey.value) return <KeyForm />;
  switch (state.kind) {
    case "open":
      return null;
    case "sending":
      return <Sending name={state.name} share={state.share} />;
    case "refused":
      return <Refused />;
    case "lost":
      return <Lost />;
    case "empty":
      return <Empty />;
  }
}

function Empty() {
  const formats = capabilities.value?.mesh_formats ?? ["obj", "gltf", "glb", "stl", "ply"];
  return (
    <div class="cover is-empty" data-test="empty">
      <DropMark />
      <h2 class="title">{matchMedia("(hover: none)").matches ? strings.open.headingTouch : strings.open.heading}</h2>
      <p>{strings.open.what}</p>
      <Openers />
      <p class="quiet">
        {strings.open.formats(formats)}.{" "}
        {capabilities.value && strings.open.limit(capabilities.value.limits.body_bytes)}
      </p>
      <p class="quiet">{strings.open.privacy(location.host)}</p>
      <div class="without">
        <span class="quiet">{strings.open.without}</span>
        <pre tabIndex={0} data-test="curl">
          {strings.open.curl(address("v1/render"))}
        </pre>
        <p class="quiet">
          <a href={address("openapi.json")}>{strings.open.interface}</a> ·{" "}
          <a href={address("v1/schema")}>{strings.open.schema}</a> ·{" "}
          <a href={address("status")}>{strings.status.title}</a>
        </p>
      </div>
    </div>
  );
}

function DropMark() {
  return (
    <svg class="mark" viewBox="0 0 64 64" width="64" height="64" aria-hidden="true">
      <path
        d="M32 6 56 19v26L32 58 8 45V19Z M8 19l24 13 24-13 M32 32v26"
        fill="none"
        stroke="currentColor"
        stroke-width="1.5"
        stroke-linejoin="round"
      />
    </svg>
  );
}

function Openers() {
  const files = useRef<HTMLInputElement>(null);
  const folder = useRef<HTMLInputElement>(null);
  const take = (input: HTMLInputElement) => {
    const chosen = filesOfInput(input.files!);
    input.value = "";
    if (chosen.length > 0) void openFiles(chosen);
  };
  return (
    <div class="openers">
      <button type="button" class="primary" onClick={() => files.current?.click()} data-test="choose-files">
        {strings.open.files}
      </button>
      <button type="button" onClick={() => folder.current?.click()} data-test="choose-folder">
        {strings.open.folder}
      </button>
      <button type="button" onClick={() => void openSample()} data-test="sample">
        {strings.open.sample}
      </button>
      <input ref={files} type="file" multiple hidden onChange={(e) => take(e.currentTarget)} data-test="files-input" />
      <input
        ref={folder}
        type="file"
        hidden
        {...{ webkitdirectory: true }}
        onChange={(e) => take(e.currentTarget)}
        data-test="folder-input"
      />
    </div>
  );
}

function Sending({ name, share }: { name: string; share: number }) {
  return (
    <div class="cover" data-test="sending">
      <h2 class="title">{share < 1 ? strings.open.sending(name) : strings.open.reading}</h2>
      <progress value={share < 1 ? share : undefined} max={1} aria-label={strings.open.sending(name)} />
      <button type="button" onClick={cancelUpload}>
        {strings.open.cancel}
      </button>
    </div>
  );
}

function Refused() {
  const state = phase.value;
  if (state.kind !== "refused") return null;
  const files = lastFiles();
  return (
    <div class="cover" data-test="refused">
      {state.choices.length > 0 && files ? (
        <Choices paths={state.choices} files={files} />
      ) : (
        <>
          <h2 class="title">
            <bdi>{strings.refused.heading(state.name)}</bdi>
          </h2>
          {state.code === "mesh_unrecognised" && (
            <p>{strings.refused.noMesh(capabilities.value?.mesh_formats ?? [])}</p>
          )}
          <p role="alert" class="refusal-text" data-test="refusal" data-code={state.code}>
            {state.detail}
          </p>
          {state.flag && !state.detail.includes(state.flag) && <p class="quiet">{strings.refused.flag(state.flag)}</p>}
        </>
      )}
      <Openers />
      {mesh.value && (
        <button type="button" class="link" onClick={() => (phase.value = { kind: "open" })}>
          {strings.refused.back}
        </button>
      )}
    </div>
  );
}

/** The files among which one is to be chosen as the mesh. */
function Choices({ paths, files }: { paths: string[]; files: NamedFile[] }) {
  return (
    <>
      <h2 class="title">{strings.refused.choose}</h2>
      <ul class="choices">
        {paths.slice(0, 100).map((path) => (
          <li key={path}>
            <button type="button" onClick={() => void openFiles(files, path)} data-test={`entry-${path}`}>
              <bdi>{path}</bdi>
            </button>
          </li>
        ))}
      </ul>
    </>
  );
}

function Lost() {
  const state = phase.value;
  if (state.kind !== "lost") return null;
  return (
    <div class="cover" data-test="lost">
      <h2 class="title">{strings.lost.heading}</h2>
      <p>
        <bdi>{strings.lost.text(state.name)}</bdi>
      </p>
      <Openers />
    </div>
  );
}

function KeyForm() {
  const input = useRef<HTMLInputElement>(null);
  const use = (event: Event) => {
    event.preventDefault();
    const key = input.current?.value.trim();
    if (!key) return;
    keepKey(key);
    void begin().then(goOnWithKey);
  };
  return (
    <form class="cover" onSubmit={use} data-test="key-form">
      <h2 class="title">{strings.key.heading}</h2>
      <p class="quiet">{strings.key.text}</p>
      {keyIsWrong.value && (
        <p role="alert" class="refusal-text" data-test="key-wrong">
          {strings.key.wrong}
        </p>
      )}
      <div class="openers">
        <label class="key-label">
          {strings.key.label} <input ref={input} type="password" autocomplete="off" data-test="key" />
        </label>
        <button type="submit" class="primary" data-test="key-use">
          {strings.key.save}
        </button>
      </div>
    </form>
  );
}
