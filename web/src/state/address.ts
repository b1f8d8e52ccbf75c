import { address } from "../api/base";
import { type Look, pairsOf, queryOf } from "./look";
import { type OpenMesh, readingPairs } from "./mesh";
import { extension, type Format, type Size, sizeText } from "./size";

/** A picture of a stored mesh. */
export interface Picture {
  mesh: OpenMesh;
  look: Look;
  size: Size;
  format: Format;
}

/** Path of a picture, relative to the page's folder. */
export function picturePath({ mesh, look, size, format }: Picture): string {
  const pairs: [string, string][] = [...readingPairs(mesh), ...pairsOf(look), ["size", sizeText(size)]];
  return `v1/meshes/${mesh.sha256}/render.${extension(format)}?${queryOf(pairs)}`;
}

export function pictureAddress(picture: Picture): string {
  return address(picturePath(picture));
}
