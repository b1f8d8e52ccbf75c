/** Address of the folder that the page lies in, so that any path prefix in front works. */
export const base: string = new URL(".", location.href.split(/[?#]/)[0]).href;

/** Absolute address of a path below the page's folder. */
export function address(path: string): string {
  return base + path;
}
