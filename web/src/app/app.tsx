import { signal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { needsKey } from "../api/key";
import { compareFiles } from "../compare/menu";
import { compare } from "../compare/state";
import { Controls } from "../controls/controls";
import { Materials } from "../controls/materials";
import { CopyPanel } from "../copy/copy";
import { filesOfDrop } from "../files/drop";
import { openFiles } from "../files/open";
import { Looks } from "../picture/looks";
import { Stage } from "../picture/stage";
import { ExplainPanel } from "../report/explain";
import { ReportPanel } from "../report/report";
import { redo, undo } from "../state/history";
import { phase } from "../state/phase";
import { strings } from "../strings";
import { Cover } from "./cover";
import { Header } from "./header";
import { Notices } from "./notices";
import { narrow, narrowQuery, tab, TABS } from "./tab";

const dropping = signal(false);

export function App() {
  useEffect(() => listen(), []);
  const isOpen = phase.value.kind === "open" && !needsKey.value;
  return (
    <>
      <button
        type="button"
        class="skip"
        onClick={() => document.querySelector<HTMLElement>(".picture, .cover button")?.focus()}
      >
        {strings.skip}
      </button>
      <Header />
      <main class={isOpen ? "bench" : "bench is-empty"} data-tab={tab.value}>
        {isOpen ? <Bench /> : <Cover />}
      </main>
      <Notices />
      {dropping.value && (
        <div class="drop-hint" aria-hidden="true">
          {compare.value?.mesh ? strings.open.dropCompare : strings.open.dropHint}
        </div>
      )}
    </>
  );
}

function Bench() {
  const side = tab.value === "looks" || tab.value === "copy" ? "settings" : tab.value;
  const selected = narrow.value ? tab.value : side;
  return (
    <>
      <nav class="panel left" aria-label={strings.tabs.looks}>
        <Looks />
      </nav>
      <Stage />
      <div class="below">
        <CopyPanel />
      </div>
      <div class="panel right">
        <div class="tabs" role="tablist" aria-label={strings.tabs.panels} onKeyDown={tabKeys}>
          {TABS.map((name) => (
            <button
              type="button"
              role="tab"
              key={name}
              id={`tab-${name}`}
              class={`tab tab-${name}`}
              aria-selected={selected === name}
              aria-controls="panel"
              tabIndex={selected === name ? 0 : -1}
              data-test={`tab-${name}`}
              onClick={() => (tab.value = name)}
            >
              {strings.tabs[name]}
            </button>
          ))}
        </div>
        <div class="panel-body" role="tabpanel" id="panel" aria-labelledby={`tab-${side}`} tabIndex={-1}>
          {side === "settings" && <Controls />}
          {side === "materials" && <Materials />}
          {side === "report" && <ReportPanel />}
          {side === "explain" && <ExplainPanel />}
        </div>
      </div>
    </>
  );
}

/** Left and right move between the tabs that are visible. */
function tabKeys(event: KeyboardEvent): void {
  const step = event.key === "ArrowRight" ? 1 : event.key === "ArrowLeft" ? -1 : 0;
  if (step === 0) return;
  const list = event.currentTarget as HTMLElement;
  const visible = [...list.querySelectorAll<HTMLElement>("[role=tab]")].filter((one) => one.offsetParent !== null);
  const at = visible.findIndex((one) => one === document.activeElement);
  const next = visible[(at + step + visible.length) % visible.length];
  next?.click();
  next?.focus();
}

/** Drops anywhere on the page, and keys that work everywhere. */
function listen(): () => void {
  const off = new AbortController();
  const on = { signal: off.signal };
  narrowQuery.addEventListener("change", () => (narrow.value = narrowQuery.matches), on);
  const hasFiles = (event: DragEvent) => event.dataTransfer?.types.includes("Files") ?? false;
  addEventListener(
    "dragover",
    (event) => {
      if (!hasFiles(event)) return;
      event.preventDefault();
      dropping.value = true;
    },
    on,
  );
  addEventListener(
    "dragleave",
    (event) => {
      if (!event.relatedTarget) dropping.value = false;
    },
    on,
  );
  addEventListener(
    "drop",
    (event) => {
      dropping.value = false;
      if (!event.dataTransfer || !hasFiles(event)) return;
      event.preventDefault();
      const into = compare.value?.mesh ? compareFiles : (files: Parameters<typeof openFiles>[0]) => openFiles(files);
      void filesOfDrop(event.dataTransfer).then(into);
    },
    on,
  );
  addEventListener(
    "keydown",
    (event) => {
      const typing =
        event.target instanceof HTMLInputElement && /^(text|search|number|password)$/.test(event.target.type);
      if (!(event.ctrlKey || event.metaKey) || typing) return;
      const key = event.key.toLowerCase();
      if (key === "z" && !event.shiftKey) undo();
      else if ((key === "z" && event.shiftKey) || key === "y") redo();
      else return;
      event.preventDefault();
    },
    on,
  );
  return () => off.abort();
}
