// Colour maps that remain readable with every common deficiency of colour vision: lightness alone tells the order.

export interface ColourMap {
  name: string;
  diverging: boolean;
  anchors: string[];
}

export const MAPS: Record<string, ColourMap> = {
  // Blue and orange are told apart by everyone; both ends are dark, zero is light.
  "blue-orange": { name: "Blue – orange", diverging: true, anchors: ["#0b2a5b", "#1f5fa8", "#5b9bd0", "#a9cde6", "#f6f3ee", "#f5c98f", "#e08a3a", "#b1560f", "#5e2a05"] },
  "purple-green": { name: "Purple – green", diverging: true, anchors: ["#3b0f57", "#6f3f97", "#a583c2", "#d6c6e2", "#f6f4f6", "#c9e4c4", "#86bf85", "#3f8a4c", "#0f4a25"] },
  // Cividis (Nuñez, Anderton and Renslow 2018) and viridis, both in the public domain.
  cividis: { name: "Cividis", diverging: false, anchors: ["#00224e", "#123570", "#3b496c", "#575d6d", "#707173", "#8a8678", "#a59c74", "#c3b369", "#e1cc55", "#fee838"] },
  viridis: { name: "Viridis", diverging: false, anchors: ["#440154", "#482878", "#3e4a89", "#31688e", "#26828e", "#1f9e89", "#35b779", "#6ece58", "#b5de2b", "#fde725"] },
};

/** A map as RGBA bytes. */
export function table(map: ColourMap, size = 256): Uint8Array {
  const anchors = map.anchors.map((hex) => [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16)));
  const bytes = new Uint8Array(4 * size);
  for (let i = 0; i < size; i++) {
    const t = (i / (size - 1)) * (anchors.length - 1);
    const k = Math.min(Math.floor(t), anchors.length - 2);
    for (let c = 0; c < 3; c++) bytes[4 * i + c] = Math.round(anchors[k][c] + (t - k) * (anchors[k + 1][c] - anchors[k][c]));
    bytes[4 * i + 3] = 255;
  }
  return bytes;
}

/** A map as a gradient of CSS. */
export const gradient = (map: ColourMap) => `linear-gradient(to right, ${map.anchors.join(", ")})`;
