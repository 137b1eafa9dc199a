/* Bounded reader of JSON (RFC 8259), for the description of a share.
 *
 * It reads forward through `at` .. `end`, and copies texts to a buffer that is as large as the input: a
 * decoded text with its final zero byte is shorter than the JSON string. After the first error, `failed`
 * is set and every function returns zero. Numbers do not depend on the locale.
 */
#ifndef CATENARY_SHARE_JSON_H
#define CATENARY_SHARE_JSON_H

#include <stdint.h>
#include <string.h>

enum { CAT_JSON_DEPTH = 32 };

typedef struct cat_json {
    const char *at;
    const char *end;
    char *text;                       /* next free byte of the buffer for texts */
    int failed;
} cat_json;

static void cat_json_fail(cat_json *j) {
    j->failed = 1;
    j->at = j->end;
}

/* Return the next byte that is not white space, without taking it; 0 at the end. */
static char cat_json_peek(cat_json *j) {
    while (j->at < j->end && (*j->at == ' ' || *j->at == '\n' || *j->at == '\r' || *j->at == '\t')) j->at++;
    return j->at < j->end ? *j->at : '\0';
}

static int cat_json_take(cat_json *j, char expected) {
    if (j->at >= j->end || cat_json_peek(j) != expected) return 0;
    j->at++;
    return 1;
}

static void cat_json_need(cat_json *j, char expected) {
    if (!cat_json_take(j, expected)) cat_json_fail(j);
}

/* Return the value of four hexadecimal digits. */
static uint32_t cat_json_hex(cat_json *j) {
    uint32_t value = 0;
    int k;
    for (k = 0; k < 4; k++) {
        char c = j->at < j->end ? *j->at++ : '\0';
        if (c >= '0' && c <= '9') value = value * 16 + (uint32_t)(c - '0');
        else if ((c | 32) >= 'a' && (c | 32) <= 'f') value = value * 16 + (uint32_t)((c | 32) - 'a' + 10);
        else cat_json_fail(j);
    }
    return value;
}

static void cat_json_put_utf8(cat_json *j, uint32_t code) {
    if (code < 0x80) {
        *j->text++ = (char)code;
        return;
    }
    if (code < 0x800) *j->text++ = (char)(0xC0 | code >> 6);
    else {
        if (code < 0x10000) *j->text++ = (char)(0xE0 | code >> 12);
        else {
            *j->text++ = (char)(0xF0 | code >> 18);
            *j->text++ = (char)(0x80 | (code >> 12 & 0x3F));
        }
        *j->text++ = (char)(0x80 | (code >> 6 & 0x3F));
    }
    *j->text++ = (char)(0x80 | (code & 0x3F));
}

/* Decode the digits after \u, and the second half of a surrogate pair. */
static void cat_json_unicode(cat_json *j) {
    uint32_t code = cat_json_hex(j), low;
    if (code >= 0xD800 && code < 0xDC00 && j->end - j->at >= 6 && j->at[0] == '\\' && j->at[1] == 'u') {
        j->at += 2;
        low = cat_json_hex(j);
        code = low >= 0xDC00 && low < 0xE000 ? 0x10000 + ((code - 0xD800) << 10) + (low - 0xDC00) : '?';
    }
    if (code == 0 || (code >= 0xD800 && code < 0xE000)) code = '?';
    if (!j->failed) cat_json_put_utf8(j, code);
}

static void cat_json_escape(cat_json *j) {
    static const char codes[] = "\"\\/bfnrt", values[] = "\"\\/\b\f\n\r\t";
    char c = j->at < j->end ? *j->at++ : '\0';
    const char *found = c ? strchr(codes, c) : NULL;
    if (found) *j->text++ = values[found - codes];
    else if (c == 'u') cat_json_unicode(j);
    else cat_json_fail(j);
}

/* Read a string. Return a text that ends with a zero byte; "" after an error. */
static const char *cat_json_string(cat_json *j) {
    char *start = j->text;
    cat_json_need(j, '"');
    while (!j->failed) {
        char c = j->at < j->end ? *j->at++ : '\0';
        if (c == '"') {
            *j->text++ = '\0';
            return start;
        }
        if (c == '\\') cat_json_escape(j);
        else if ((unsigned char)c < 0x20) cat_json_fail(j);  /* includes the end of the input */
        else *j->text++ = c;
    }
    return "";
}

static int cat_json_digit(const cat_json *j) { return j->at < j->end && *j->at >= '0' && *j->at <= '9'; }

/* Read an integer from -(2^63 - 1) to 2^63 - 1. */
static int64_t cat_json_integer(cat_json *j) {
    int negative = cat_json_take(j, '-');
    int64_t value = 0;
    if (cat_json_peek(j) == '\0' || !cat_json_digit(j)) cat_json_fail(j);
    for (; cat_json_digit(j); j->at++) {
        if (value > (INT64_MAX - (*j->at - '0')) / 10) {
            cat_json_fail(j);
            return 0;
        }
        value = value * 10 + (*j->at - '0');
    }
    return negative ? -value : value;
}

/* Read an integer from 0. */
static uint64_t cat_json_count(cat_json *j) {
    int64_t value = cat_json_integer(j);
    if (value < 0) cat_json_fail(j);
    return value < 0 ? 0 : (uint64_t)value;
}

static double cat_json_power(int64_t exponent) {
    double power = 1.0;
    for (; exponent > 0; exponent--) power *= 10.0;
    return power;
}

/* Read a real number. It is exact for up to 15 digits and exponents up to 22, which covers periods. */
static double cat_json_number(cat_json *j) {
    int negative = cat_json_take(j, '-'), digits = 0;
    double value = 0.0;
    int64_t exponent = 0;
    cat_json_peek(j);
    for (; cat_json_digit(j); j->at++, digits++) value = value * 10.0 + (*j->at - '0');
    if (j->at < j->end && *j->at == '.') {
        for (j->at++; cat_json_digit(j); j->at++, digits++, exponent--) value = value * 10.0 + (*j->at - '0');
    }
    if (!digits) cat_json_fail(j);
    if (j->at < j->end && (*j->at | 32) == 'e') {
        j->at++;
        if (j->at < j->end && *j->at == '+') j->at++;
        exponent += cat_json_integer(j);
    }
    if (exponent > 400 || exponent < -400) cat_json_fail(j);
    value = exponent < 0 ? value / cat_json_power(-exponent) : value * cat_json_power(exponent);
    return negative ? -value : value;
}

static int cat_json_word(cat_json *j, const char *word) {
    size_t length = strlen(word);
    cat_json_peek(j);
    if ((size_t)(j->end - j->at) < length || memcmp(j->at, word, length) != 0) return 0;
    j->at += length;
    return 1;
}

static int cat_json_bool(cat_json *j) {
    if (cat_json_word(j, "true")) return 1;
    if (!cat_json_word(j, "false")) cat_json_fail(j);
    return 0;
}

/* Begin the next item of an array or object. The opening bracket is the separator of the first item.
 * `count` is 0 at first. Return 0 at the closing bracket or after an error. */
static int cat_json_next(cat_json *j, uint32_t *count, char open, char close) {
    if (*count == 0) {
        cat_json_need(j, open);
        if (cat_json_take(j, close)) return 0;
    } else if (cat_json_take(j, close)) return 0;
    else cat_json_need(j, ',');
    (*count)++;
    return !j->failed;
}

static int cat_json_item(cat_json *j, uint32_t *count) { return cat_json_next(j, count, '[', ']'); }

/* Read the key of the next member of an object. Return NULL at its end or after an error. */
static const char *cat_json_key(cat_json *j, uint32_t *count) {
    const char *key;
    if (!cat_json_next(j, count, '{', '}')) return NULL;
    key = cat_json_string(j);
    cat_json_need(j, ':');
    return j->failed ? NULL : key;
}

/* Skip any value, to read descriptions with more members. */
static void cat_json_skip(cat_json *j, int depth) {
    char c = cat_json_peek(j), *text = j->text;
    uint32_t count = 0;
    if (depth > CAT_JSON_DEPTH) cat_json_fail(j);
    else if (c == '"') cat_json_string(j);
    else if (c == '[') while (cat_json_item(j, &count)) cat_json_skip(j, depth + 1);
    else if (c == '{') while (cat_json_key(j, &count)) cat_json_skip(j, depth + 1);
    else if (c == '-' || (c >= '0' && c <= '9')) cat_json_number(j);
    else if (c != 'n' && c != '\0') cat_json_bool(j);
    else if (!cat_json_word(j, "null")) cat_json_fail(j);
    j->text = text;
}

#endif
