import{n as a,o as b,p as c}from"./chunk-SJXVRDZ2.js";import"./chunk-GOUYFB7N.js";import"./chunk-BYXBJQAS.js";export{a as Scope,b as useFrames,c as useTheme};
