import { useRef } from "preact/hooks";
import { address } from "../api/base";
import { apiKey, forgetKey } from "../api/key";
import { copied, copyText } from "../copy/copy";
import { filesOfInput } from "../files/drop";
import { openFiles } from "../files/open";
import { shareLink } from "../state/link";
import { mesh, report } from "../state/mesh";
import { phase } from "../state/phase";
import { strings } from "../strings";

export function Header() {
  const input = useRef<HTMLInputElement>(null);
  const open = mesh.value;
  const isOpen = open && phase.value.kind === "open";
  return (
    <header class="top">
      <h1 class="brand">
        <a href="#" title={strings.home} data-test="home">
          {strings.name}
        </a>
      </h1>
      {isOpen && (
        <span class="file" title={open.name}>
          <bdi data-test="mesh-name">{open.name}</bdi>
          {report.value && <span class="quiet"> {strings.content(report.value)}</span>}
        </span>
      )}
      <span class="spring" />
      {apiKey.value && (
        <button
          type="button"
          class="link"
          onClick={() => {
            forgetKey();
            location.reload();
          }}
          data-test="key-forget"
        >
          {strings.key.forget}
        </button>
      )}
      {isOpen && (
        <>
          <a class="status-link" href={address("status")}>
            {strings.status.title}
          </a>
          <button
            type="button"
            onClick={() => void copyText(shareLink(), "share")}
            title={strings.copy.shareHelp}
            data-test="share"
          >
            {copied.value === "share"
              ? strings.copy.shared
              : copied.value === "share-failed"
                ? strings.copy.shareFailed
                : strings.copy.share}
          </button>
          <button type="button" onClick={() => input.current?.click()} data-test="open">
            {strings.open.another}
          </button>
          <input
            ref={input}
            type="file"
            multiple
            hidden
            data-test="open-input"
            onChange={(e) => {
              const files = filesOfInput(e.currentTarget.files!);
              e.currentTarget.value = "";
              if (files.length > 0) void openFiles(files);
            }}
          />
        </>
      )}
    </header>
  );
}
