import { signal } from "@preact/signals";
import { search } from "../controls/controls";

export const TABS = ["looks", "settings", "materials", "report", "explain", "copy"] as const;
export type Tab = (typeof TABS)[number];

/** True where one panel shows at a time; looks then come first. */
export const narrowQuery = matchMedia("(max-width: 860px)");
export const narrow = signal(narrowQuery.matches);
export const tab = signal<Tab>(narrow.value ? "looks" : "settings");

/** Shows the control of a key and moves the focus to it. */
export function showKey(key: string): void {
  search.value = "";
  tab.value = key.startsWith("materials.") ? "materials" : "settings";
  setTimeout(() => {
    const row = document.querySelector(`[data-key="${CSS.escape(key)}"]`);
    row?.scrollIntoView({ block: "center" });
    row?.querySelector<HTMLElement>(".numeric > :last-child, select, .colour [type=text], input, .segment")?.focus();
  }, 50);
}
