#!/bin/sh
# The course as a book: lessons/README.md as one page of HTML, with its pictures beside it.
#
#   sh lessons/book.sh DIRECTORY        writes DIRECTORY/index.html; copies lessons/img and the programs there
#
# It knows as much of Markdown as lessons/README.md uses: headings, paragraphs, fenced and indented code, tables, lists,
# pictures, links, bold, italics, code, and HTML lines, which stay as they are. What it does not know is an error of
# the text: a fence that stays open fails.

set -u
LC_ALL=C
export LC_ALL
dir=${1:?directory}
mkdir -p "$dir/img" || exit 1
cp lessons/img/* "$dir/img/" && cp lessons/*.c "$dir/" || exit 1

awk '
    function escaped(s) { gsub(/&/, "\\&amp;", s); gsub(/</, "\\&lt;", s); gsub(/>/, "\\&gt;", s); return s }

    # The part of s that opens with mark and ends at its next occurrence becomes an element; again and again.
    function pairs(s, mark, element,    i, j, out, n) {
        n = length(mark)
        while ((i = index(s, mark)) > 0 && (j = index(substr(s, i + n), mark)) > 1) {
            out = out substr(s, 1, i - 1) "<" element ">" substr(s, i + n, j - 1) "</" element ">"
            s = substr(s, i + 2 * n + j - 1)
        }
        return out s
    }

    # [text](address), with or without ! before it.
    function links(s,    out, text, address) {
        while (match(s, /!?\[[^]]*\]\([^)]*\)/)) {
            text = substr(s, RSTART, RLENGTH)
            out = out substr(s, 1, RSTART - 1)
            s = substr(s, RSTART + RLENGTH)
            address = text; sub(/.*\]\(/, "", address); sub(/\)$/, "", address)
            is_image = text ~ /^!/
            sub(/^!?\[/, "", text); sub(/\]\(.*/, "", text)
            if (is_image) out = out "<figure><img src=\"" address "\" alt=\"" text "\"></figure>"
            else out = out "<a href=\"" address "\">" text "</a>"
        }
        return out s
    }

    # Code is taken out first and put back last, so that nothing in it is seen as a mark.
    function inline(s,    n, i, j, code) {
        s = escaped(s)
        gsub(/\\\*/, "\002", s); gsub(/\\\|/, "\003", s); gsub(/\\_/, "_", s)
        gsub(/\\&/, "\\&", s)
        while (match(s, /\\[-+#.)]/)) s = substr(s, 1, RSTART - 1) substr(s, RSTART + 1)
        while ((i = index(s, "`")) > 0 && (j = index(substr(s, i + 1), "`")) > 1) {
            code[++n] = substr(s, i + 1, j - 1)
            s = substr(s, 1, i - 1) "\001" n "\001" substr(s, i + j + 1)
        }
        s = links(s)
        s = pairs(s, "**", "strong")
        while (match(s, /\*[^* ][^*]*\*/))
            s = substr(s, 1, RSTART - 1) "<em>" substr(s, RSTART + 1, RLENGTH - 2) "</em>" substr(s, RSTART + RLENGTH)
        for (i = 1; i <= n; i++) {
            j = index(s, "\001" i "\001")
            s = substr(s, 1, j - 1) "<code>" code[i] "</code>" substr(s, j + 2 + length(i ""))
        }
        gsub(/\002/, "*", s); gsub(/\003/, "|", s)
        return s
    }

    function anchor(s) {
        s = tolower(s); gsub(/[^a-z0-9 _-]/, "", s); gsub(/ /, "-", s)
        return s
    }

    function close_block() {
        if (block == "p" && text ~ /^!\[[^]]*\]\([^)]*\)$/) print inline(text)
        else if (block == "p") print "<p>" inline(text) "</p>"
        if (block == "li") print "<li>" inline(text) "</li>"
        if (list != "" && block != "li") { print "</" list ">"; list = "" }
        if (block == "table") print "</table></div>"
        block = text = ""
    }
    function close_all() { close_block(); if (list != "") { print "</" list ">"; list = "" } }

    function table_row(s,    n, i, cell, tag) {
        gsub(/\\\|/, "\003", s)
        sub(/^\| ?/, "", s); sub(/ ?\|$/, "", s)
        n = split(s, cell, / ?\| ?/)
        tag = rows++ == 0 ? "th" : "td"
        printf "<tr>"
        for (i = 1; i <= n; i++) { gsub(/\003/, "\\|", cell[i]); printf "<%s>%s</%s>", tag, inline(cell[i]), tag }
        print "</tr>"
    }

    /^```/ {
        if (code) print "</code></pre>"
        else { close_all(); printf "<pre><code>" }
        code = !code
        next
    }
    code { print escaped($0); next }
    /^<!--/ { next }
    /^<\/?(details|summary|br|p|div)/ { close_all(); print; next }
    /^#+ / {
        close_all()
        n = length($1)
        title = substr($0, n + 2)
        printf "<h%d id=\"%s\">%s</h%d>\n", n, anchor(title), inline(title), n
        next
    }
    /^\|[-| :]*\|$/ { next }
    /^\|/ {
        if (block != "table") { close_all(); block = "table"; rows = 0; print "<div class=\"scroll\"><table>" }
        table_row($0)
        next
    }
    /^    [^ ]/ && block == "" {
        close_all()
        print "<pre><code>" escaped(substr($0, 5))
        while ((more = getline line) > 0 && line ~ /^    /) print escaped(substr(line, 5))
        print "</code></pre>"
        next
    }
    /^([-*]|[0-9]+\.) / {
        wanted = $1 ~ /^[0-9]/ ? "ol" : "ul"
        if (block == "li") { print "<li>" inline(text) "</li>"; text = "" } else close_block()
        if (list != wanted) { if (list != "") print "</" list ">"; list = wanted; print "<" list ">" }
        block = "li"
        sub(/^([-*]|[0-9]+\.) +/, "")
        text = $0
        next
    }
    /^ *$/ { close_block(); next }
    block == "li" { sub(/^ +/, ""); text = text " " $0; next }
    { if (block != "p") { close_all(); block = "p"; text = $0 } else text = text " " $0 }
    END { close_all(); if (code) exit 1 }
' lessons/README.md > "$dir/body.html" || { echo "book: a fence of lessons/README.md stays open"; exit 1; }

{
    cat << 'END'
<!DOCTYPE html><html lang="en"><head><meta charset="utf-8">
<meta name="viewport" content="width=device-width,initial-scale=1"><title>From the first image to a path tracer</title>
<style>body{font:16px/1.5 system-ui,sans-serif;max-width:60rem;margin:2rem auto;padding:0 1rem;color:#222}
h2{margin-top:3rem;border-top:1px solid #ccc;padding-top:1rem}figure{margin:1rem 0}img{max-width:100%;height:auto}
pre{background:#f6f6f4;padding:.7rem;overflow-x:auto;font-size:13px;line-height:1.35}code{font-family:ui-monospace,monospace}
.scroll{overflow-x:auto}table{border-collapse:collapse;font-size:14px}
td,th{padding:.2rem .6rem;text-align:left;border-bottom:1px solid #ddd;vertical-align:top}
@media print{body{max-width:none;margin:0;font-size:11px}h2{break-before:page}pre{font-size:9px;white-space:pre-wrap}}
</style></head><body>
END
    cat "$dir/body.html"
    echo '</body></html>'
} > "$dir/index.html"
rm -f "$dir/body.html"
echo "wrote $dir/index.html"
