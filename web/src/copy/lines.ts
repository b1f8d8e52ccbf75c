import { address } from "../api/base";
import { type Picture, pictureAddress } from "../state/address";
import { documentOf, pairsOf, type Value } from "../state/look";
import { stem } from "../state/mesh";
import { extension, sizeText } from "../state/size";
import { attribute, literal, markdown, shell } from "./quote";

export const KINDS = [
  "url",
  "signed",
  "curl",
  "json",
  "command",
  "python",
  "javascript",
  "srcset",
  "markdown",
] as const;
export type LineKind = (typeof KINDS)[number];

interface Context {
  /** True if the server asks for keys: lines then send the one of MESHSNAP_KEY. */
  keyed: boolean;
  /** Largest side of a picture. */
  limit: number;
}

/** The text of a kind, which gives the picture as it stands. */
export function lineOf(kind: LineKind, picture: Picture, context: Context): string {
  const url = pictureAddress(picture);
  const file = `${stem(picture.mesh)}.${extension(picture.format)}`;
  switch (kind) {
    case "url":
      return url;
    case "signed":
      return `meshsnap sign ${shell(url)} --expires 1d`;
    case "curl":
      return curl(url, file, context);
    case "json":
      return JSON.stringify(requestDocument(picture), null, 2);
    case "command":
      return commandLine(picture, file);
    case "python":
      return python(url, file, context);
    case "javascript":
      return javascript(url, context);
    case "srcset":
      return srcset(picture, context);
    case "markdown":
      return `![${markdown(stem(picture.mesh))}](${url})`;
  }
}

function curl(url: string, file: string, { keyed }: Context): string {
  const key = keyed ? ' -H "Authorization: Bearer $MESHSNAP_KEY"' : "";
  return `curl -f${key} ${shell(url)} -o ${shell(file)}`;
}

/** The body of a POST to v1/render that draws a stored mesh. */
function requestDocument(picture: Picture): { [name: string]: Value } {
  const document = documentOf(picture.look);
  const { width, height } = picture.size;
  const image = { ...(document["image"] as object), width, height, format: picture.format };
  return { mesh: picture.mesh.sha256, ...document, image };
}

/** Address that the request document goes to: how the mesh is read is said there. */
export function documentAddress(picture: Picture): string {
  const { entry, formatIn } = picture.mesh;
  const query = new URLSearchParams({
    ...(entry !== null && { entry }),
    ...(formatIn !== null && { format_in: formatIn }),
  });
  return address(`v1/render${query.size > 0 ? `?${query}` : ""}`);
}

const FLAGS: Record<string, string> = {
  "style": "--style",
  "camera.view": "--view",
  "camera.up": "--up",
  "image.samples": "--samples",
  "image.background": "--background",
  "backend": "--backend",
};

function commandLine(picture: Picture, file: string): string {
  const words = ["meshsnap", "render", picture.mesh.name, "-o", file];
  const size = sizeText(picture.size);
  for (const [key, value] of pairsOf(picture.look)) {
    const flag = FLAGS[key];
    if (flag && value !== "null" && !value.startsWith("-")) words.push(flag, value);
    else words.push("--set", `${key}=${value}`);
  }
  return [...words, "--size", size].map(shell).join(" ");
}

function python(url: string, file: string, { keyed }: Context): string {
  const key = keyed ? ', headers={"Authorization": "Bearer " + os.environ["MESHSNAP_KEY"]}' : "";
  return [
    ...(keyed ? ["import os"] : []),
    "import urllib.request",
    "",
    `request = urllib.request.Request(${literal(url)}${key})`,
    `with urllib.request.urlopen(request) as answer, open(${literal(file)}, "wb") as file:`,
    "    file.write(answer.read())",
  ].join("\n");
}

function javascript(url: string, { keyed }: Context): string {
  const key = keyed ? ", { headers: { Authorization: `Bearer ${process.env.MESHSNAP_KEY}` } }" : "";
  return [
    `const answer = await fetch(${literal(url)}${key});`,
    "if (!answer.ok) throw new Error((await answer.json()).detail);",
    "const picture = await answer.blob();",
  ].join("\n");
}

function srcset(picture: Picture, { limit }: Context): string {
  const { width, height } = picture.size;
  const url = pictureAddress(picture);
  const twice = { width: width * 2, height: height * 2 };
  const fits = Math.max(twice.width, twice.height) <= limit;
  const dense = fits ? `, ${pictureAddress({ ...picture, size: twice })} 2x` : "";
  const parts = [`src=${attribute(url)}`, `srcset=${attribute(`${url} 1x${dense}`)}`];
  return `<img ${parts.join(" ")} width="${width}" height="${height}" alt=${attribute(stem(picture.mesh))}>`;
}
